#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

/// What the stages share. Frames: W world, B base, L link, S sensor, T tool. `T_WL` maps L to W;
/// the suffix of a value names the frame it is expressed in. SI units and radians throughout.
namespace proxcgal {

/// Bounds of the tick's fixed storage: nothing in the loop allocates.
inline constexpr int kMaxJoints = 32;
inline constexpr int kMaxRows = 32;  ///< rows of one task
inline constexpr int kMaxLevels = 16;
inline constexpr int kZones = 64;  ///< 8 x 8, row by row

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// [m] from the origin, at most: squares stay far inside single precision.
inline constexpr double kFarthest = 1e9;

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;           ///< (n, 3) [m]
using Triangles = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (f, 3)
using PointsRef = Eigen::Ref<const Points>;
using Vector3 = Eigen::Vector3d;
using Pose = Eigen::Isometry3d;

using JointVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;
using JointMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxJoints, kMaxJoints>;
using RowVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxRows, 1>;
using TaskJacobian =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaxRows, kMaxJoints>;
using Jacobian6 = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxJoints>;

/// One sensor's packet: what a VL53L8CX board sends.
struct Scan {
  int sensor = 0;                             ///< row of the skin
  std::uint32_t counter = 0;                  ///< advances with every measurement
  double stamp = 0.0;                         ///< [s] when it was measured, on the caller's clock
  std::array<double, kZones> ranges{};        ///< [m] along the sensor's z axis
  std::array<std::uint8_t, kZones> status{};  ///< target status, 5 is valid
};

/// Where a sensed point comes from.
struct PointOrigin {
  int sensor = -1;
  int zone = -1;
};

/// The nearest obstacle point and the robot surface point nearest to it.
struct ClosestPair {
  double distance = kInfinity;  ///< [m] unsigned
  /// The search was cut short: the true distance is at least `distance`, and the points are where
  /// it may be least.
  bool lower_bound = false;
  int link = -1;  ///< row of the robot's links
  Vector3 surface_W = Vector3::Zero();
  Vector3 obstacle_W = Vector3::Zero();
  int point = -1;  ///< row of the cloud

  bool found() const { return link >= 0; }
};

/// One control objective of the stack: rate that J qd should have, row by row.
struct Task {
  TaskJacobian jacobian;  ///< (m, n)
  RowVector rate;         ///< (m,) reference rate
  RowVector activation;   ///< (m,) 0 free to 1 enforced
};

/// How freely the arm may move. Faults only move right.
enum class Mode : std::uint8_t { kRun, kDegraded, kHold, kStop };

/// What the monitor can find. `safety/monitor` maps each to a mode.
enum class Reason : std::uint8_t {
  kSensorSilent,        ///< no new scan within the freshness bound
  kAllSensorsSilent,    ///< the whole skin silent
  kArraySilent,         ///< every sensor of one array silent
  kSensorSuspect,       ///< the same payload again and again under an advancing counter
  kBlindMotion,         ///< what was solved moves into what a silent sensor covered
  kScanRefused,         ///< unknown sensor, repeated or older counter, stamp in the future
  kZoneInvalid,         ///< not finite, not positive, or a status that is not valid
  kJointStateInvalid,   ///< not finite or of the wrong size
  kJointStateStale,     ///< older than a control loop may be
  kJointStateLost,      ///< so old that where the arm is is unknown
  kGoalInvalid,         ///< not finite or not a rigid pose
  kTimeInvalid,         ///< not finite, not later than the last, or over 0.5 s later
  kNoControllableLink,  ///< the nearest link cannot be moved away: its row n'J is too small
  kLinkSkipped,         ///< a nearer link was passed over because its row n'J is too small
  kRowSmall,            ///< a scalar task row had a norm under 0.01 before scaling
  kNotExecuted,         ///< avoidance asked for more than limits or rank allow
  kAvoidanceStuck,      ///< inside d_min, and not executed for a while
  kPinched,             ///< what is to be retreated from on one side is blocked by another
  kContact,             ///< a pair inside d_min was taken for body since: kept as an obstacle
  kOutsideLimits,       ///< a joint is outside its position limits
  kDeadlineMissed,      ///< the caller's word
  kDeadlinesMissed,     ///< too many in a row
  kWorkBounded,         ///< a search, the filter or memory was cut short: a bound, points kept
  kPointsInvalid,       ///< known points or their velocity not finite, or too many
  kMountsUnchecked,     ///< nobody has said yet that the sensors sit where they are said to
  kJointStateUnits,     ///< so far outside its limits that it may be in degrees
  kNotFollowing,        ///< the arm does not do what it is commanded; `link` is the joint
  kLoopSlow,            ///< ticks come later than the nominal period, on average
  kSingular,            ///< the goal asks for motion that no joint gives from this posture
  kHeldOff,             ///< held for the same reason again and again: until `reset`
};

/// One thing the monitor found in this tick.
struct Finding {
  Reason reason = Reason::kSensorSilent;
  int sensor = -1;   ///< -1 where none is concerned
  int zone = -1;     ///< -1 where none is concerned
  int link = -1;     ///< -1 where none is concerned
  double age = 0.0;  ///< [s] of the data concerned
  int count = 1;     ///< how many times in this tick
};

}  // namespace proxcgal
