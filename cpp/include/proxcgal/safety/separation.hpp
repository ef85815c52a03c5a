#pragma once
#include <string>
#include <vector>

#include "proxcgal/fields.hpp"
#include "proxcgal/geometry/capsule.hpp"
#include "proxcgal/robot.hpp"

namespace proxcgal {

/// The capsule of one link, in its frame. By [WT] the end of one is the start of the next.
struct LinkCapsule {
  std::string name;  ///< for messages, and for lists of monitored pairs
  int link = -1;     ///< row of the robot's links
  Capsule shape_L;
};

/// The operator: one capsule that rides on the tool, [WT] 2.2. It stands upright however the tool
/// is turned; `offset_T` is where its middle is.
struct OperatorCapsule {
  double radius = 0.200;
  double height = 1.80;
  Vector3 offset_T = Vector3(0.0, 0.0, 0.25);
  Capsule at(const Pose& T_WT) const;
};

template <>
inline constexpr auto fields<OperatorCapsule> = field_table(
    "OperatorCapsule", "Capsule of the operator, which rides on the tool and stands upright.",
    field(&OperatorCapsule::radius, "radius", "m", above(0), "opRad: radius."),
    field(&OperatorCapsule::height, "height", "m", above(0), "opH: height, rounding included."),
    field(&OperatorCapsule::offset_T, "offset", "m", finite(),
          "opRelP: position of its middle in the tool's frame."));
void check(const OperatorCapsule& config, const std::string& path);

/// Terms of the separation distance of ISO/TS 15066.
struct IsoSeparation {
  double human_speed = 1.6;
  double reaction_time = 1.0 / 15.0;
  double intrusion = 0.0;
  double human_uncertainty = 0.0;
  double robot_uncertainty = 0.0;
};

template <>
inline constexpr auto fields<IsoSeparation> = field_table(
    "IsoSeparation", "Terms of the separation distance of ISO/TS 15066.",
    field(&IsoSeparation::human_speed, "human_speed", "m/s", at_least(0),
          "v_h: speed of the human, by ISO 13855."),
    field(&IsoSeparation::reaction_time, "reaction_time", "s", at_least(0),
          "T_r: reaction time, one frame of a sensor that would see the human."),
    field(&IsoSeparation::intrusion, "intrusion", "m", finite(), "C: intrusion distance."),
    field(&IsoSeparation::human_uncertainty, "human_uncertainty", "m", finite(),
          "Z_d: position uncertainty of the human."),
    field(&IsoSeparation::robot_uncertainty, "robot_uncertainty", "m", finite(),
          "Z_r: position uncertainty of the robot."));
void check(const IsoSeparation& iso, const std::string& path);

/// S_p = v_h (T_r + T_s) + v_r T_r + v_r T_s / 2 + C + Z_d + Z_r [m]: constant speeds, constant
/// deceleration over the stopping time T_s.
double protective_distance(const IsoSeparation& iso, double robot_speed, double stop_time);

struct SeparationConfig {
  OperatorCapsule human;
  std::vector<std::string> pairs;
  std::vector<std::string> ends;
  double min_distance = 0.455;
  double max_velocity = 1.30;
  bool subtract_human = false;
  IsoSeparation iso;
};

template <>
inline constexpr auto fields<SeparationConfig> = field_table(
    "SeparationConfig", "Limits of distance and relative velocity between robot and operator.",
    field(&SeparationConfig::min_distance, "min_distance", "m", at_least(0),
          "minDistTh: least distance to the operator."),
    field(&SeparationConfig::max_velocity, "max_velocity", "m/s", above(0),
          "maxVelTh: maximum velocity towards the operator."),
    field(&SeparationConfig::pairs, "pairs",
          "Names of the capsules whose distance counts; empty: all."),
    field(&SeparationConfig::ends, "ends",
          "Names of the capsules whose far ends' velocity counts; empty: all."),
    fields_of(&SeparationConfig::human, "human_"),
    field(&SeparationConfig::subtract_human, "subtract_human",
          "Velocity is relative to the operator, where the operator's is known."),
    field(&SeparationConfig::iso, "iso", "Terms of the separation distance of ISO/TS 15066."));

/// What one cycle found.
struct SeparationOutput {
  bool distance_ok = false, velocity_ok = false;  ///< relDistOk, relVelOk of [WT] eq. (4)
  double distance = kInfinity;                    ///< [m] least over the monitored pairs
  int pair = -1;                                  ///< its row among the capsules
  double velocity = -kInfinity;                   ///< [m/s] most, positive towards the operator
  int end = -1;                                   ///< its row among the capsules
  double protective_distance = 0.0;  ///< [m] ISO/TS 15066, at the velocity of this cycle
};

/// Functional logic of [WT] Fig. 5: distances and relative velocities between robot and operator.
/// It knows nothing of torque; the safety logic gets two booleans of it.
class Separation {
 public:
  /// @param capsules   of the robot, base first
  /// @param stop_time  [s] declared
  /// @throws ConfigError  a name that no capsule has, a bound that is not positive
  Separation(const Robot& robot, std::vector<LinkCapsule> capsules, SeparationConfig config,
             double stop_time);

  /// @param human_velocity_W  [m/s] of the operator, zero where it is not known
  const SeparationOutput& update(const Robot& robot, const Posture& posture, const JointVector& qd,
                                 const Vector3& human_velocity_W);

  const SeparationOutput& output() const { return output_; }
  const std::vector<LinkCapsule>& capsules() const { return capsules_; }
  const std::vector<int>& pairs() const { return pairs_; }  ///< rows of the monitored capsules
  const std::vector<int>& ends() const { return ends_; }
  const SeparationConfig& config() const { return config_; }
  /// Least distance of one capsule to the operator's at a posture [m].
  double distance(int row, const Posture& posture) const;

 private:
  std::vector<LinkCapsule> capsules_;
  SeparationConfig config_;
  double stop_time_;
  std::vector<int> pairs_, ends_;
  SeparationOutput output_;
};

}  // namespace proxcgal
