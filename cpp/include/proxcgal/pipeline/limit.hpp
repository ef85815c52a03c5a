#pragma once
#include <array>
#include <memory>
#include <span>

#include "proxcgal/pipeline/limit_config.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Longest time a command may be held [s]: at least three nominal periods, and the longest recent
/// interval times a margin. Forgets a long interval in about 100 ticks.
class PeriodBound {
 public:
  PeriodBound(double period, double margin) : period_(period), margin_(margin) {}
  void update(double interval);
  double value() const;

 private:
  double period_, margin_;
  double longest_ = 0.0;
};

/// (0) The velocities that each joint may take, each (n,): low <= high, always.
struct JointInterval {
  JointVector low, high;
};

/// (0) The fastest velocity from which a joint that slows by a D every D covers at most `room`.
/// @param a  deceleration, above 0
double viable_speed(double room, double a, double D);
/// (0) Velocity, acceleration over the time that passed since the last command, and viability of
/// the position limit while a command is held for up to `max_period`.
/// @param elapsed     [s] since the last command
/// @param max_period  [s] above 0
void joint_interval(const Limits& limits, const JointVector& q, const JointVector& qd_last,
                    double elapsed, double max_period, JointInterval& out);

/// All joints brake together, straight to rest in the time tau = max |qd_j| / qdd_max_j; a joint
/// whose interval asks for more brakes harder. Inside the interval.
void brake_together(const Limits& limits, const JointVector& qd_last, double elapsed,
                    const JointInterval& interval, JointVector& out);

enum class LimitKind : std::uint8_t {
  kJoint,        ///< (0); `link` is the joint
  kApproach,     ///< (1) a seen or remembered point
  kOwnApproach,  ///< (1) another link of the robot
  kFloor,        ///< (1)
  kUnknown,      ///< (1) volume not known to be free
  kRetreat,      ///< (2) a control point
  kOwnRetreat,   ///< (2) another link of the robot
};

/// (1) row qd >= -c.
struct ApproachCap {
  JointVector row;              ///< (n,) n'J, derivative of the distance by the joints
  double distance = kInfinity;  ///< [m] signed, less what sigma, mesh error and age take off
  double stop = 0.05;           ///< [m] no approach nearer than this
  double near = 0.10;           ///< [m] nearer than this at near_speed at most; 0 for own links
  double speed = kInfinity;     ///< [m/s] another bound on c, as for unknown volume
  LimitKind kind = LimitKind::kApproach;
  int link = -1;
};

/// (2) row qd + s >= rate.
struct RetreatRow {
  JointVector row;              ///< (n,) n'J, derivative of the distance by the joints
  double distance = kInfinity;  ///< [m] signed
  double d_min = 0.20;          ///< [m]
  double gain = 2.0;            ///< [1/s]
  double obstacle_rate = 0.0;   ///< [m/s] n'v_o: how fast the obstacle closes the distance
  double speed = kInfinity;     ///< [m/s] another bound on the rate, as into unknown volume
  LimitKind kind = LimitKind::kRetreat;
  int link = -1;
};

/// (1) Fastest approach c [m/s] at distance d.
///
/// From the closing speed c the joints, braking together, close another c reaction + c^2 / (2 a),
/// a = c / braking_time. That is c = a (sqrt(T^2 + 2 (d - d_stop) / a) - T), solved for this a:
/// c = (d - stop) / (T + braking_time / 2). Nearer than `near` at most near_speed; farther at most
/// the speed from which near_speed is reached at `near`.
/// @param cap           its distance, stop, near and speed
/// @param reaction      T [s]
/// @param braking_time  [s] until all joints rest
double approach_speed(const LimitConfig& config, const ApproachCap& cap, double reaction,
                      double braking_time);
/// (1) The distance from which `speed` is allowed on: the inverse of `approach_speed` [m].
double approach_distance(const LimitConfig& config, const ApproachCap& cap, double speed,
                         double reaction, double braking_time);
/// (2) max(0, n'v_o) + gain (d_min - d), at most retreat_speed nearer than d_stop; the bound rises
/// steeply, not in a step, beyond d_stop.
double retreat_rate(const LimitConfig& config, const RetreatRow& row);
/// (2) Weight of a row, in (0, 1]: falls smoothly with the time to contact.
double retreat_weight(const RetreatRow& row);

inline constexpr int kMaxCaps = 32;
inline constexpr int kMaxRetreats = 16;

/// What a tick asks for, once `Limiter::begin` knows its state.
struct LimitInput {
  const JointVector& nominal;  ///< (n,) what the solver asks for
  std::span<const Task> tasks = {};
  std::span<const ApproachCap> caps = {};     ///< the first kMaxCaps are weighed, all are kept
  std::span<const RetreatRow> retreats = {};  ///< nearest first; at most kMaxRetreats are read
};

/// State of a tick, and what of it limits every velocity.
struct LimitState {
  bool usable = false;        ///< joint state, last command and interval are finite
  JointInterval interval;     ///< (0)
  JointVector qd_brake;       ///< all joints brake together, inside the interval
  double reaction = 0.0;      ///< T of (1) [s]
  double braking_time = 0.0;  ///< [s] until all joints rest
};

/// A row that changed the command.
struct ActiveLimit {
  LimitKind kind = LimitKind::kJoint;
  int link = -1;          ///< or joint
  double distance = 0.0;  ///< [m]; infinite for a joint
  double rate = 0.0;      ///< row qd of the command [m/s]; the joint's velocity
};

enum class LimitStatus : std::uint8_t {
  kUnchanged,  ///< the nominal, bit for bit
  kLimited,
  kPartly,   ///< a programme failed: the last level that was solved
  kBraking,  ///< input not finite or of the wrong size, or no programme solved: all joints brake
};

struct LimitOutput {
  JointVector qd;
  LimitStatus status = LimitStatus::kBraking;
  std::array<ActiveLimit, 2 * kMaxJoints + kMaxCaps + kMaxRetreats> active;
  int n_active = 0;
  std::array<double, kMaxRetreats> share{};  ///< of each retreat row's rate that qd has, [0, 1]
  int n_retreats = 0;
  /// Share of the retreat demands that one another and the caps block, and not the joints; [0, 1].
  double contradiction = 0.0;
  bool pinched = false;
  double stand = 0.0;      ///< in [0, 1]: taken off the nominal where pinched
  double violation = 0.0;  ///< t of (2a) [m/s]
  int programmes = 0;      ///< solved in this call
  int iterations = 0;      ///< of all of them

  std::span<const ActiveLimit> limited() const {
    return {active.data(), static_cast<std::size_t>(n_active)};
  }
};

/// The only stage after the solver that changes a velocity.
///
/// (0) `joint_interval`. (1) Approach caps row qd >= min(-c, row qd_brake), so that the braking
/// command fulfils (0) and (1) whatever the rows are. (2a) The largest violation of the retreat
/// rows is made least, where a row leaves over the first 0.04 m beyond d_stop: none enters or
/// leaves in a step. (2b) The weighted sum of squares of all violations is made least. (3) The
/// command nearest to the nominal in W = sum of w_k J_k' A_k J_k + eps I; the first level of the
/// stack has w = 1, each one below it `level_ratio` of the one above, so that lower levels yield
/// first. (2a) and (2b) are solved only where (3) has no solution with every retreat row fulfilled.
///
/// Storage is made at set-up. A call allocates nothing, never throws, and its work is bounded.
class Limiter {
 public:
  /// @throws ConfigError  a setting out of bounds, or limits that are not finite where they must be
  Limiter(const Limits& limits, const LimitConfig& config, double period);
  ~Limiter();
  Limiter(Limiter&&) noexcept;
  Limiter& operator=(Limiter&&) noexcept;

  /// Begins a tick. @param q  (n,) measured
  /// @param qd_last  (n,) last command
  /// @param elapsed  [s] since that command
  /// @param joint_state_age  [s] of q; counts where it is more than the configured one
  const LimitState& begin(const JointVector& q, const JointVector& qd_last, double elapsed,
                          double joint_state_age = 0.0);
  /// The command of the tick that `begin` began; zero where its state is not usable.
  const LimitOutput& limit(const LimitInput& input);
  /// The same where a fault forbids everything but braking.
  const LimitOutput& brake();
  const LimitState& state() const;
  const LimitConfig& config() const;
  double max_period() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
