#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proxcgal/pipeline/command.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/pipeline/memory.hpp"
#include "proxcgal/pipeline/motion.hpp"
#include "proxcgal/pipeline/sense.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/safety/monitor.hpp"

namespace proxcgal {

/// What the avoidance task moves.
enum class ControlPoint : std::uint8_t {
  kWholeBody,  ///< the surface point nearest to the cloud, any link
  kSensor,     ///< the mounting point of the sensor nearest to the cloud (SM baseline)
};

/// When a point that passed the filter is believed.
enum class Confirmation : std::uint8_t {
  kOff,
  kZones,  ///< a neighbouring zone of the same scan sees a similar range
  kScans,  ///< the zone saw a similar range in one of the last two scans as well
};

struct FilterConfig {
  double tolerance = 0.02;     ///< [m] epsilon of Algorithm 1
  double sigmas = 4.0;         ///< the tolerance is at least this many sigma(range)
  double min_hit = 0.005;      ///< [m] nearer hits are the sensor's own mounting
  bool surface_margin = true;  ///< also drop what lies that near to any link's surface
  Confirmation confirmation = Confirmation::kOff;
  double z_min = -kInfinity;  ///< [m] world height below which points are cropped (floor)
  void validate() const;
};

struct ControllerConfig {
  ControlPoint control_point = ControlPoint::kWholeBody;
  std::vector<TaskSpec> tasks = {Avoidance{}, Reach{}};  ///< the order is the priority
  FilterConfig filter;
  SolverConfig solver;
  MonitorConfig monitor;
  double period = 0.01;                  ///< [s] nominal time from tick to tick
  double min_row_norm = 0.05;            ///< a link whose row n'J is smaller is passed over
  std::vector<std::string> avoid_links;  ///< empty: every link that some joint moves
  Method method = Method::kFast;
  int max_points = 200000;  ///< storage for known points, made at set-up
  bool timings = false;
  std::optional<MemoryConfig> memory;  ///< of what left the sensors' view; none: as in the paper
  std::optional<MotionConfig> motion;  ///< x_o of eq. (4) from the scans; none: taken for zero

  /// @throws ConfigError  with the field, its value and what is allowed
  void validate() const;
};

/// What one task wanted and got.
struct TaskReport {
  const char* name = "";
  RowVector rate, activation, residual;
};

struct Timings {
  double sense_us = 0, filter_us = 0;
  double memory_us = 0;    ///< memory and motion
  double distance_us = 0;  ///< closest pair, control points, task rows
  double solve_us = 0;     ///< solver and command
  double total_us = 0;
};

/// Everything one tick tells. Reused: copy what you keep.
struct TickOutput {
  JointVector qd;  ///< [rad/s] or [m/s] admissible velocity
  /// Nearest of the links that joints can move away. In whole-body mode it drives the arm; its
  /// point is a row of `cloud_W` (`tick`) or of the points given (`tick_known`).
  std::optional<ClosestPair> pair;
  double pair_distance() const;  ///< [m] of the pair, infinity for none
  PointOrigin pair_origin;       ///< sensor and zone that saw it, where one did
  double pair_age = 0.0;         ///< [s] since it was measured, where it was
  bool pair_remembered = false;  ///< no current scan shows it any more
  /// [m] what of the pair's distance is still to be trusted: less the way that something may have
  /// come since the scan was fresh, negative where the obstacle is inside the surface.
  double trusted_distance = kInfinity;
  /// [m/s] of the pair's obstacle: as estimated (`tick`) or given (`tick_known`).
  Vector3 obstacle_velocity_W = Vector3::Zero();
  ControlPair control;  ///< what the first avoidance row acts on, with its obstacle's velocity
  LinkPair own;         ///< what the first self-collision row acts on
  Mode mode = Mode::kRun;
  int n_tasks = 0;
  std::array<TaskReport, kMaxLevels> tasks;
  Timings timings;
};

inline double TickOutput::pair_distance() const {
  if (!pair) return kInfinity;
  return pair->distance;
}

/// What is kept of one tick, for whoever asks why the arm stopped.
struct TickRecord {
  double time = 0.0;  ///< [s] the caller's
  Mode mode = Mode::kRun;
  JointVector q, qd;
  double distance = kInfinity;  ///< [m] of the pair
  int link = -1;
  PointOrigin origin;
  int n_findings = 0;  ///< all of them; the first are kept
  std::array<Finding, 8> findings{};
};
inline constexpr int kKeptTicks = 64;

/// The tick: sense -> filter -> memory -> distance -> task -> solve -> command, under the monitor.
///
/// Set-up throws; a tick never throws, allocates, locks, logs, or reads a clock for a decision.
/// Not thread-safe: one controller, one thread.
class Controller {
 public:
  /// @param robot  kept alive by the controller
  /// @throws ConfigError  every setting that is out of bounds, a sensor on an unknown link
  Controller(std::shared_ptr<const Robot> robot, Skin skin, ControllerConfig config);
  ~Controller();

  /// @param time   [s] the caller's monotonic clock
  /// @param q      (n_q,) measured
  /// @param scans  since the last tick, may be empty
  /// @param goal   T_WT
  /// @param late   the caller missed its deadline since the last tick
  /// @param q_stamp  [s] when q was measured, on the same clock; none: just now
  const TickOutput& tick(double time, const JointVector& q, std::span<const Scan> scans,
                         const Pose& goal, bool late = false,
                         std::optional<double> q_stamp = std::nullopt);
  /// The scene itself instead of scans.
  /// @param points_W      (n, 3), n <= max_points
  /// @param velocities_W  of the obstacles [m/s]: a row for each point, one for all, or none where
  ///                      they are not known
  const TickOutput& tick_known(double time, const JointVector& q, const PointsRef& points_W,
                               const Pose& goal, const PointsRef& velocities_W = Points(0, 3));

  /// @name State of the last tick
  /// @{
  std::span<const Finding> findings() const;
  /// What `tick` avoids: the filtered points of the sensors' last scans, then those remembered.
  Eigen::Map<const Points> cloud_W() const;
  std::span<const PointOrigin> cloud_origins() const;
  Eigen::Index seen_points() const;  ///< rows of `cloud_W` that the last scans show
  /// [s] since each row of `cloud_W` was measured.
  std::vector<double> cloud_ages(double time) const;
  /// Every point of the sensors' last scans before body removal, in world.
  Eigen::Map<const Points> raw_cloud_W() const;
  std::vector<double> scan_ages(double time) const;  ///< [s] per sensor, infinity where none came
  /// The last ticks, at most kKeptTicks, the oldest first. After a STOP they stay as they were when
  /// it came, until `reset`.
  std::vector<TickRecord> last_ticks() const;
  /// @}

  const Robot& robot() const;
  const Skin& skin() const;
  const ControllerConfig& config() const;
  /// Leaves STOP, only once its cause is gone; true where it did.
  bool reset();
  /// The sensors sit where the skin says: ends the HOLD of `monitor.await_mounts`. For whoever has
  /// compared what they see of the arm itself with what they must see.
  void accept_mounts();
  /// Other values for the same tasks in the same order, from the next tick on; what was seen, what
  /// was commanded and the mode stay. Not part of the tick: it may throw, and changes nothing then.
  /// @throws ConfigError  other tasks or another order, a value out of bounds
  void retune(const std::vector<TaskSpec>& tasks);
  /// Commands go on from a velocity instead of from rest: for a controller that takes over an arm
  /// that moves. Not part of the tick.
  /// @param qd  (n_q,) commanded last [rad/s] or [m/s]
  /// @throws ConfigError  another size, not finite, above a joint's limit
  void go_on_from(const JointVector& qd);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
