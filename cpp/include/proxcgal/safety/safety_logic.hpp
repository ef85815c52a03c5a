#pragma once
#include <array>
#include <cstdint>

#include "proxcgal/fields.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// What can cut the torque. Where several do in one cycle, the first of them is named.
enum class SafetyFunction : std::uint8_t {
  kInput,              ///< a joint state that is not finite
  kCycle,              ///< a cycle that came too late, or a clock that does not advance
  kTcpSpeed,           ///< [WT] eq. (3), first line
  kJointSpeed,         ///< second line
  kJointAcceleration,  ///< third line
  kDistance,           ///< eq. (4): relDistOk
  kRelativeVelocity,   ///< eq. (4): relVelOk
};
inline constexpr int kSafetyFunctions = 7;
const char* function_name(SafetyFunction function);

/// Upper bounds of the basic safety functions.
struct SafetyLimits {
  double tcp_speed = 1.30;  ///< [m/s] xd_UB
  JointVector qd;           ///< [rad/s] qd_UB, eq. (1)
  JointVector qdd;          ///< [rad/s^2] qdd_UB, eq. (2)
};

/// [WT] eqs. (1) and (2) at a reference posture. A joint that does not move the tool there keeps
/// its own maximum.
/// @param q        (n,) reference posture
/// @param qd_max   (n,) [rad/s]
/// @param qdd_max  (n,) [rad/s^2]
SafetyLimits basic_limits(const Robot& robot, const JointVector& q, double tcp_speed,
                          const JointVector& qd_max, const JointVector& qdd_max, double stop_time);

/// Why the torque was cut.
struct Trip {
  SafetyFunction function = SafetyFunction::kInput;
  double time = 0.0;   ///< [s] the caller's
  double value = 0.0;  ///< what was found
  double limit = 0.0;  ///< what is allowed
  int row = -1;        ///< joint or capsule concerned, -1 for none
};

enum class TorqueState : std::uint8_t {
  kOff,       ///< brakes hold; also at the start
  kOn,        ///< Safe Torque Off is not demanded
  kStopping,  ///< torque is off, the arm is not yet at rest
};

template <>
inline constexpr auto choices<TorqueState> =
    std::array{Choice{"off", TorqueState::kOff}, Choice{"on", TorqueState::kOn},
               Choice{"stopping", TorqueState::kStopping}};

/// What the safety logic is told in one cycle.
struct SafetyInput {
  double time = 0.0;  ///< [s] the caller's monotonic clock
  double tcp_speed = 0.0;
  JointVector qd;                                 ///< (n,) measured
  bool distance_ok = false, velocity_ok = false;  ///< from the functional logic, eq. (4)
  double distance = 0.0, min_distance = 0.0;      ///< only to be told in a trip
  double velocity = 0.0, max_velocity = 0.0;      //
  int pair = -1, end = -1;                        //
  bool finite = false;                            ///< is the joint state?
  bool reset = false;                             ///< the button; what counts is that it goes down
};

struct SafetyOutput {
  bool torque = false;  ///< the STO signal: true lets the motors have torque
  TorqueState state = TorqueState::kOff;
  std::uint32_t violated = 0;  ///< bit by SafetyFunction, in this cycle
  Trip trip;                   ///< of the last stop
  int trips = 0;               ///< so far
  double stop_time = 0.0;      ///< [s] since the torque was cut, until rest
  bool overrun = false;        ///< an arm was not at rest in time, or moved again under its brakes
  bool reset_refused = false;  ///< the button went down, in this cycle, for nothing
  double speed_ratio = 0.0;    ///< largest |qd| / qd_UB
  double acceleration_ratio = 0.0;  ///< largest |qdd| / qdd_UB
};

struct SafetyTiming {
  double stop_time = 0.35;
  double rest_speed = 0.01;
  double period = 0.001;
  double max_gap = 0.0025;
};

template <>
inline constexpr auto fields<SafetyTiming> = field_table(
    "SafetyTiming", "Times of the safety logic.",
    field(&SafetyTiming::stop_time, "stop_time", "s", above(0),
          "stopT: declared stopping time, after which the arm is at rest."),
    field(&SafetyTiming::rest_speed, "rest_speed", "rad/s", above(0),
          "Speed of every joint at rest, at most."),
    field(&SafetyTiming::period, "period", "s", above(0), "Period of the cycle."),
    field(&SafetyTiming::max_gap, "max_gap", "s", above(0), "A longer cycle cuts the torque."));
void check(const SafetyTiming& timing, const std::string& path);

/// Safety logic of [WT] Fig. 5: the basic safety functions, and Safe Torque Off.
///
/// Torque is off at the start and after every violation, and comes back in one way only: the reset
/// goes down while the arm is at rest, no function is violated, and no stop took longer than
/// declared. It knows of distances only whether they are fine.
class SafetyLogic {
 public:
  /// @throws ConfigError  a limit or time that is not positive
  SafetyLogic(SafetyLimits limits, SafetyTiming timing);

  const SafetyOutput& cycle(const SafetyInput& input);
  const SafetyOutput& output() const { return output_; }
  const SafetyLimits& limits() const { return limits_; }
  const SafetyTiming& timing() const { return timing_; }

 private:
  void check(const SafetyInput& input);
  void violate(SafetyFunction function, double value, double limit, int row);
  void advance(const SafetyInput& input, bool pressed);

  SafetyLimits limits_;
  SafetyTiming timing_;
  SafetyOutput output_;
  Trip found_;  ///< first violation of this cycle
  JointVector qd_last_;
  double time_last_ = 0.0;  ///< [s] of `qd_last_`
  double time_seen_ = 0.0;  ///< [s] of the last cycle, whatever its joint state
  bool first_ = true;       ///< no cycle before this one
  bool reset_last_ = true;  ///< a button that is down at the start counts for nothing
  double since_cut_ = 0.0;  ///< [s]
};

}  // namespace proxcgal
