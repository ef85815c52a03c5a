#pragma once
#include <memory>
#include <string>
#include <vector>

#include "proxcgal/safety/separation.hpp"
#include "proxcgal/safety/torque_logic.hpp"

namespace proxcgal {

/// Everything the guard of walk-through programming is set up with, [WT] section 3.
struct GuardConfig {
  std::vector<LinkCapsule> capsules;
  SeparationConfig separation;
  SafetyTiming timing;
  double tcp_speed = 1.30;
  JointVector q_reference;
  JointVector qd_max, qdd_max;
  std::vector<std::string> accept;
};

template <>
inline constexpr auto fields<GuardConfig> = field_table(
    "GuardConfig", "Set-up of the guard of walk-through programming. Source: [WT] section 3.",
    field(&GuardConfig::capsules, "capsules", "", at_least(1),
          "Capsules of the robot's links, base first.")
        .required(),
    field(&GuardConfig::q_reference, "q_reference", "rad", finite(),
          "Posture of eqs. (1) and (2), one number a joint.")
        .required(),
    field(&GuardConfig::tcp_speed, "tcp_speed", "m/s", above(0).or_infinite(),
          "xd_UB: maximum speed of the tool."),
    field(&GuardConfig::qd_max, "qd_max", "rad/s", finite(),
          "Maximum speeds of eq. (1), one a joint; empty: the robot's own."),
    field(&GuardConfig::qdd_max, "qdd_max", "rad/s^2", finite(),
          "Maximum accelerations of eq. (2), one a joint; empty: the robot's own."),
    fields_of(&GuardConfig::timing), fields_of(&GuardConfig::separation),
    field(&GuardConfig::accept, "accept",
          "Contradictions that are accepted, item by item, as `guard_contradictions` names them."));

/// A setting that another one contradicts.
struct Contradiction {
  std::string item;  ///< as `accept` names it
  std::string text;  ///< a sentence with the numbers
};

/// What contradicts what:
/// - `stopping_distance`: the arm covers more than `min_distance` at `tcp_speed` while it stops;
/// - `closing_distance`: the same at `max_velocity`;
/// - `joint_stop.NAME`: that joint can't stop from its bound of eq. (1) in time at its greatest
///   acceleration, which eq. (2) would need;
/// - `pair.NAME`: that capsule is nearer than `min_distance` to the operator in every posture (of
///   2000 drawn within the joints' limits, always the same ones).
/// @throws ConfigError  a setting that is out of bounds by itself
std::vector<Contradiction> contradictions(const Robot& robot, const GuardConfig& config);

struct GuardOutput {
  SafetyOutput safety;
  SeparationOutput separation;
  double tcp_speed = 0.0;  ///< [m/s]
};

/// Guard of walk-through programming: one call a cycle, [WT] Fig. 5.
///
/// Kinematics feed two modules that know nothing of one another: the functional logic
/// (`Separation`) gives two booleans, the safety logic (`SafetyLogic`) has the torque.
/// A cycle never throws, allocates, locks, or reads a clock.
class Guard {
 public:
  /// @throws ConfigError  settings out of bounds; contradictions that `accept` does not name, one
  ///                      line each; names in `accept` where nothing is to be accepted
  Guard(std::shared_ptr<const Robot> robot, GuardConfig config);

  /// @param time   [s] the caller's monotonic clock
  /// @param q      (n,) measured
  /// @param qd     (n,) measured
  /// @param reset  the button; what counts is that it goes down
  /// @param human_velocity_W  [m/s] of the operator, zero where it is not known
  const GuardOutput& cycle(double time, const JointVector& q, const JointVector& qd, bool reset,
                           const Vector3& human_velocity_W = Vector3::Zero());

  const GuardOutput& output() const { return output_; }
  const Robot& robot() const { return *robot_; }
  const GuardConfig& config() const { return config_; }
  const SafetyLimits& limits() const { return logic_.limits(); }
  const Separation& separation() const { return separation_; }
  /// What was accepted: to be printed and logged.
  const std::vector<Contradiction>& accepted() const { return accepted_; }
  /// [m] of ISO/TS 15066 at `tcp_speed`, beside the paper's `min_distance`.
  double protective_distance() const;

 private:
  std::shared_ptr<const Robot> robot_;
  GuardConfig config_;
  std::vector<Contradiction> accepted_;
  Separation separation_;
  SafetyLogic logic_;
  Posture posture_;
  SafetyInput input_;
  GuardOutput output_;
};

}  // namespace proxcgal
