#pragma once
#include <array>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Keep the robot away from the nearest obstacle: [WA] eqs. (4) to (7).
struct Avoidance {
  double d_min = 0.20;
  double buffer = 0.10;
  double gain = 2.0;
  int nearest = 1;
};

template <>
inline constexpr auto fields<Avoidance> = field_table(
    "Avoidance", "Keep the robot away from the nearest obstacle. Source: [WA] eqs. (4) to (7).",
    field(&Avoidance::d_min, "d_min", "m", at_least(0), "Distance to keep."),
    field(&Avoidance::buffer, "buffer", "m", above(0),
          "Delta: the activation rises from 0 to 1 inside it."),
    field(&Avoidance::gain, "gain", "1/s", above(0), "lambda: gain of the rate."),
    field(&Avoidance::nearest, "nearest", "", between(1, kMaxRows),
          "Number of nearest links that get a row each."));

/// What of the goal is reached for: all of it in one level, or one half.
enum class ReachRows : std::uint8_t { kBoth, kPosition, kOrientation };
template <>
inline constexpr auto choices<ReachRows> =
    std::array{Choice{"both", ReachRows::kBoth}, Choice{"position", ReachRows::kPosition},
               Choice{"orientation", ReachRows::kOrientation}};

/// Bring the tool to the goal: [WA] eqs. (8) to (10), both rates saturated.
struct Reach {
  double gain = 1.0;
  double max_linear = 0.25;
  double max_angular = 0.5;
  ReachRows rows = ReachRows::kBoth;
};

template <>
inline constexpr auto fields<Reach> = field_table(
    "Reach", "Bring the tool to the goal, both rates saturated. Source: [WA] eqs. (8) to (10).",
    field(&Reach::gain, "gain", "1/s", above(0), "lambda: gain of the rates."),
    field(&Reach::max_linear, "max_linear", "m/s", above(0), "Maximum linear speed."),
    field(&Reach::max_angular, "max_angular", "rad/s", above(0), "Maximum angular speed."),
    field(&Reach::rows, "rows", "Both halves of the goal in one level, or one of them alone.")
        .at_construction());

/// Keep every joint off its position limits.
struct JointLimits {
  double gain = 0.2;
  double margin = 0.3;
};

template <>
inline constexpr auto fields<JointLimits> =
    field_table("JointLimits", "Keep every joint off its position limits.",
                field(&JointLimits::gain, "gain", "1/s", above(0),
                      "Gain of the rate towards the middle of the range."),
                field(&JointLimits::margin, "margin", "rad or m", above(0),
                      "Distance from a limit at which the activation begins."));

/// Keep the tool above a height.
struct MinimumAltitude {
  double height = 0.30;
  double buffer = 0.10;
  double gain = 0.5;
};

template <>
inline constexpr auto fields<MinimumAltitude> =
    field_table("MinimumAltitude", "Keep the tool above a height. Source: thesis 4.2.1.1.",
                field(&MinimumAltitude::height, "height", "m", finite(),
                      "Height in world that the tool stays above."),
                field(&MinimumAltitude::buffer, "buffer", "m", above(0),
                      "Distance above the height at which the activation begins."),
                field(&MinimumAltitude::gain, "gain", "1/s", above(0), "Gain of the rate."));

/// Keep one arm's manipulability up: mu = sqrt(det(J J')) of the tool's linear and angular rows,
/// over the columns of that arm's joints.
struct Manipulability {
  double target = 0.12;
  double low = 0.02;
  double high = 0.05;
  double gain = 0.1;
  int first_joint = 0;
  int joints = 0;
  double unit = 1.0;
};

template <>
inline constexpr auto fields<Manipulability> = field_table(
    "Manipulability", "Keep one arm's manipulability sqrt(det(J J')) up; needs at least 6 joints.",
    field(&Manipulability::target, "target", "", above(0),
          "Manipulability that the rate pulls towards."),
    field(&Manipulability::low, "low", "", at_least(0), "The task is fully active below."),
    field(&Manipulability::high, "high", "", above(0), "The task is inactive above."),
    field(&Manipulability::gain, "gain", "1/s", above(0), "Gain of the rate."),
    field(&Manipulability::first_joint, "first_joint", "", at_least(0).below(kMaxJoints),
          "First joint of the arm, from 0: 6 for the second arm of a 12-joint robot."),
    field(&Manipulability::joints, "joints", "", between(0, kMaxJoints),
          "Number of the arm's joints, 6 or more; 0: all from `first_joint` on."),
    field(&Manipulability::unit, "unit", "", above(0),
          "Unit of the manipulability: 1, or the arm's own maximum."));
void check(const Manipulability& config, const std::string& path);

/// Keep links off one another: rows for the nearest pairs of links. The same law as avoidance, the
/// other link in the obstacle's place; ours, as the thesis has no formula for it.
struct SelfCollision {
  double d_min = 0.05;
  double buffer = 0.05;
  double gain = 2.0;
  int nearest = 3;
  std::vector<std::pair<std::string, std::string>> pairs;
};

template <>
inline constexpr auto fields<SelfCollision> = field_table(
    "SelfCollision", "Keep links off one another, as avoidance does off obstacles.",
    field(&SelfCollision::d_min, "d_min", "m", at_least(0), "Distance to keep."),
    field(&SelfCollision::buffer, "buffer", "m", above(0),
          "The activation rises from 0 to 1 inside it."),
    field(&SelfCollision::gain, "gain", "1/s", above(0), "Gain of the rate."),
    field(&SelfCollision::nearest, "nearest", "", between(1, kMaxRows),
          "Number of nearest pairs of links that get a row each."),
    field(&SelfCollision::pairs, "pairs",
          "Names of the links that are watched, two and two; empty: all pairs between which there "
          "is more than one joint."));

using TaskSpec =
    std::variant<Avoidance, Reach, JointLimits, MinimumAltitude, Manipulability, SelfCollision>;
const char* task_name(const TaskSpec& spec);
/// @throws ConfigError  with the field, its value and what is allowed
void validate(const TaskSpec& spec);

}  // namespace proxcgal
