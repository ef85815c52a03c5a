#pragma once
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "freshness.hpp"
#include "joint_history.hpp"
#include "proxcgal/perception/memory.hpp"
#include "proxcgal/perception/motion.hpp"
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/pipeline/sense.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/safety/monitor.hpp"

namespace proxcgal::detail {

struct PerceptionConfig {
  FilterConfig filter;
  MonitorConfig monitor;
  Method method = Method::kFast;
  std::optional<MemoryConfig> memory;
  std::optional<MotionConfig> motion;
  bool timings = false;
};

/// From scans to the cloud that the arm avoids: sense -> filter -> memory, each sensor's last scan
/// kept in world until its next one.
class Perception {
 public:
  Perception(std::shared_ptr<const Robot> robot, const Skin& skin, const PerceptionConfig& config);

  /// @param time   internal clock [s]
  /// @param delay  internal time minus the caller's: stamps are brought to the internal clock
  void update(double time, double delay, const JointVector& q, std::span<const Scan> scans,
              Monitor& monitor);

  /// Brings in what is remembered. @param posture  of the arm now
  void remember(double time, const Posture& posture, Monitor& monitor);

  Eigen::Map<const Points> cloud_W() const { return {cloud_.data(), n_cloud_, 3}; }
  std::span<const PointOrigin> origins() const {
    return {origins_.data(), static_cast<std::size_t>(n_cloud_)};
  }
  /// Rows of the cloud that the last scans show; the others are remembered.
  Eigen::Index seen_points() const { return n_seen_; }
  double stamp(Eigen::Index row) const { return stamps_[static_cast<std::size_t>(row)]; }
  /// [m] standard deviation of the range that a point was made from.
  double sigma(Eigen::Index row) const { return sigmas_[static_cast<std::size_t>(row)]; }
  /// Velocity of the obstacle at a point of the cloud, as far as it can be told [m/s].
  Vector3 velocity_W(double time, const Vector3& obstacle_W) {
    return motion_ ? motion_->velocity_W(time, obstacle_W) : Vector3(Vector3::Zero());
  }
  /// The remembered point that must stay: the pair's, inside the distance to keep; -1 for none.
  void hold(Eigen::Index row) {
    if (memory_) memory_->hold(row < 0 ? -1 : static_cast<int>(row - n_seen_));
  }
  /// Gathered when asked for: no tick needs it.
  Eigen::Map<const Points> raw_cloud_W() const;
  const Freshness& freshness() const { return freshness_; }
  const Pose& T_LS(std::size_t sensor) const { return sensors_[sensor].T_LS; }
  int link(std::size_t sensor) const { return sensors_[sensor].link; }
  /// Rows of the cloud that came from one sensor: first, count.
  std::pair<Eigen::Index, Eigen::Index> cloud_rows(std::size_t sensor) const {
    return {sensors_[sensor].cloud_begin, sensors_[sensor].n_kept};
  }

  /// A pair inside the distance to keep: if its zone's next point is taken for body, close to where
  /// the obstacle was, it stays in the cloud. The default forgets it.
  struct Watched {
    PointOrigin origin;
    Vector3 obstacle_W = Vector3::Zero();
    double stamp = 0.0;  ///< [s] when it was measured
  };
  void watch(const Watched& watched);
  /// Is this point of the cloud, the watched one, there only because it was watched?
  bool in_contact(const PointOrigin& origin) const {
    return in_contact_ && origin.sensor == watched_.origin.sensor &&
           origin.zone == watched_.origin.zone;
  }
  double sense_us = 0, filter_us = 0, memory_us = 0;  ///< of the last update, where timings are on
  bool timings = false;

 private:
  struct Sensor {
    int link = 0;
    Pose T_LS = Pose::Identity();
    bool staged = false;           // a scan waits for the filter
    Eigen::Index cloud_begin = 0;  // its rows of the cloud
    int n_raw = 0, n_kept = 0;
    double stamp = -kInfinity;  // [s] of its last usable scan
    std::array<Vector3, kZones> raw_W, kept_W;
    std::array<std::uint8_t, kZones> zone;
    std::array<double, kZones> tolerance, sigma;  // [m] of the points kept
    bool leaves = false;                          // the points below are no longer in the cloud
    bool doubtful = false;                        // its last scan is one of a payload that is stuck
    ScanView view;
    int n_left = 0;
    std::array<RememberedPoint, kZones> left;
    // Ranges of the last three scans' surviving points, newest first, for confirmation; infinite
    // where none survived.
    std::array<std::array<double, kZones>, 3> past;
  };

  void stage(double time, const Scan& scan, double stamp, Monitor& monitor);
  void filter(Monitor& monitor);
  void keep(Sensor& sensor, int begin, int end);
  bool confirmed(const Sensor& sensor, const std::array<double, kZones>& ranges, int zone,
                 double tolerance) const;
  void gather();
  void look(const Scan& scan, double stamp, const Pose& T_WS, Sensor& sensor);
  void let_go(std::size_t id);
  void append();

  std::shared_ptr<const Robot> robot_;
  Sense sense_;
  FilterConfig config_;
  Method method_;
  double mesh_error_ = 0.0;  // of the worst link: added to every tolerance
  std::vector<Sensor> sensors_;
  Freshness freshness_;
  std::optional<Memory> memory_;
  std::optional<Motion> motion_;
  std::uint64_t appended_ = 0;  // version of the memory that is in the cloud
  Watched watched_;
  bool in_contact_ = false;
  JointHistory history_;
  std::int64_t steps_ = kSearchSteps;  // that this tick's filter and memory may still take
  Posture posture_;                    // where the arm was at the stamp being placed

  // Points of the scans of one stamp, side by side.
  struct Staged {
    std::vector<int> sensor, zone;
    std::vector<double> tolerance, sigma, range;
    Points origins_W, points_W;
    std::unique_ptr<bool[]> keep;
    Eigen::Index count = 0;
  } staged_;
  Points cloud_;
  mutable Points raw_;
  std::vector<PointOrigin> origins_;
  std::vector<double> stamps_;    // [s]
  std::vector<double> sigmas_;    // [m]
  std::unique_ptr<bool[]> body_;  // of the remembered points
  Eigen::Index n_cloud_ = 0, n_seen_ = 0;
};

}  // namespace proxcgal::detail
