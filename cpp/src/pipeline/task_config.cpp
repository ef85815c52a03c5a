#include <cmath>
#include <iterator>

#include "proxcgal/error.hpp"
#include "proxcgal/pipeline/task.hpp"

namespace proxcgal {
namespace {

bool positive(double value) { return std::isfinite(value) && value > 0.0; }

/// What keeps distances, of obstacles or of the robot's own links: one law, one set of bounds.
template <class Spec>
void check_distances(const std::string& task, const Spec& spec) {
  require(std::isfinite(spec.d_min) && spec.d_min >= 0.0, (task + ".d_min").c_str(), spec.d_min,
          "finite and at least 0 m");
  require(positive(spec.buffer), (task + ".buffer").c_str(), spec.buffer, "finite and above 0 m");
  require(positive(spec.gain), (task + ".gain").c_str(), spec.gain, "finite and above 0 1/s");
  require(spec.nearest >= 1 && spec.nearest <= kMaxRows, (task + ".nearest").c_str(), spec.nearest,
          "between 1 and " + std::to_string(kMaxRows));
}

}  // namespace

void Avoidance::validate() const { check_distances("Avoidance", *this); }

void Reach::validate() const {
  require(positive(gain), "Reach.gain", gain, "finite and above 0 1/s");
  require(positive(max_linear), "Reach.max_linear", max_linear, "finite and above 0 m/s");
  require(positive(max_angular), "Reach.max_angular", max_angular, "finite and above 0 rad/s");
}

void JointLimits::validate() const {
  require(positive(gain), "JointLimits.gain", gain, "finite and above 0 1/s");
  require(positive(margin), "JointLimits.margin", margin, "finite and above 0 rad");
}

void MinimumAltitude::validate() const {
  require(std::isfinite(height), "MinimumAltitude.height", height, "finite [m]");
  require(positive(buffer), "MinimumAltitude.buffer", buffer, "finite and above 0 m");
  require(positive(gain), "MinimumAltitude.gain", gain, "finite and above 0 1/s");
}

void Manipulability::validate() const {
  require(positive(target), "Manipulability.target", target, "finite and above 0");
  require(std::isfinite(low) && low >= 0.0, "Manipulability.low", low, "finite and at least 0");
  require(std::isfinite(high) && high > low, "Manipulability.high", high, "finite and above low");
  require(positive(gain), "Manipulability.gain", gain, "finite and above 0 1/s");
  require(first_joint >= 0 && first_joint < kMaxJoints, "Manipulability.first_joint", first_joint,
          "between 0 and " + std::to_string(kMaxJoints - 1));
  require(joints == 0 || (joints >= 6 && joints <= kMaxJoints), "Manipulability.joints", joints,
          "0 (all) or between 6 and " + std::to_string(kMaxJoints));
  require(positive(unit), "Manipulability.unit", unit, "finite and above 0");
}

void SelfCollision::validate() const { check_distances("SelfCollision", *this); }

const char* task_name(const TaskSpec& spec) {
  constexpr const char* names[] = {"avoidance",        "reach",          "joint_limits",
                                   "minimum_altitude", "manipulability", "self_collision"};
  static_assert(std::size(names) == std::variant_size_v<TaskSpec>);
  const auto* reach = std::get_if<Reach>(&spec);
  if (reach != nullptr && reach->rows == ReachRows::kPosition) return "reach_position";
  if (reach != nullptr && reach->rows == ReachRows::kOrientation) return "reach_orientation";
  return names[spec.index()];
}

void validate(const TaskSpec& spec) {
  std::visit([](const auto& task) { task.validate(); }, spec);
}

}  // namespace proxcgal
