#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fuzz/bytes.hpp"
#include "fuzz/tick_checks.hpp"
#include "proxcgal/control/controller.hpp"
#include "robots.hpp"

/// Bytes to ticks of a controller: what `fuzz/tick.cpp` and the tests run.
namespace proxcgal::fuzz {

/// What one input did.
struct TickRun {
  int ticks = 0;
  TickCounts counts;
  std::string violation;  ///< of the first tick that broke a promise; empty where none did
};

/// A controller on the test arm, its caller, and what the caller knows.
///
/// The arm obeys: q follows the last command, until the bytes say otherwise.
class TickHarness {
 public:
  static constexpr int kMostTicks = 200;
  static constexpr int kMostSensors = 4;

  explicit TickHarness(Bytes bytes)
      : bytes_(bytes),
        robot_(shared_arm()),
        sensors_(bytes_.below(kMostSensors + 1)),
        config_(make_config()),
        controller_(robot_, test::ring(sensors_, "link3"), config_),
        checks_(controller_) {
    counters_.fill(0);
    q_ = JointVector::Zero(robot_->n_q());
    for (double& angle : q_) angle = bytes_.between(-2.9, 2.9);
    Posture posture = robot_->make_posture();
    robot_->update(q_, posture);
    goal_ = posture.T_WT;
    goal_.translation() += bytes_.vector(0.5);
    points_ = Points::Zero(0, 3);
  }

  TickRun run() {
    TickRun run;
    while (!bytes_.empty() && run.ticks < kMostTicks && run.violation.empty()) {
      run.violation = step();
      if (!run.violation.empty()) run.violation = at(run.ticks) + run.violation;
      ++run.ticks;
    }
    run.counts = checks_.counts();
    return run;
  }

 private:
  /// Indexing meshes takes longer than many ticks, and a robot never changes.
  static std::shared_ptr<Robot> shared_arm() {
    static const std::shared_ptr<Robot> robot = test::arm(6, 6, 8);
    return robot;
  }

  ControllerConfig make_config() {
    ControllerConfig config;
    const int stack = bytes_.below(4);
    if (stack == 1) config.tasks = {JointLimits{}, Avoidance{.nearest = 3}, Reach{}};
    if (stack == 2) {
      config.tasks = {Avoidance{}, JointLimits{}, MinimumAltitude{}, Manipulability{}, Reach{}};
    }
    if (stack == 3) config.tasks = {Reach{}, Avoidance{}};
    if (bytes_.one_in_eight() && sensors_ > 0) config.control_point = ControlPoint::kSensor;
    config.filter.confirmation = static_cast<Confirmation>(bytes_.below(3));
    constexpr std::array periods = {0.01, 0.002, 0.05, 1e-6};
    config.period = periods[static_cast<std::size_t>(bytes_.below(4))];
    if (bytes_.one_in_eight()) config.monitor.stuck_after = 1e9;
    if (sensors_ % 2 == 0) {
      config.memory = MemoryConfig{.max_points = 100};
      config.motion = MotionConfig{};
    }
    return config;
  }

  std::string step() {
    const int odd = bytes_.byte();  // its bits: what is unusual about this tick
    const bool disturbed = (odd & 0x81) == 0x81;
    if (disturbed) disturb_joints();
    if ((odd & 0x82) == 0x82) goal_ = any_goal();
    if ((odd & 0x84) == 0x84) controller_.reset();
    const bool late = (odd & 0x88) == 0x88;
    const double step = (odd & 0x90) == 0x90 ? bytes_.mostly(-1.0, 1.0) : config_.period;
    time_ += step;
    if (!std::isfinite(time_)) time_ = step - step == 0.0 ? step : 0.0;
    const double time = (odd & 0xA0) == 0xA0 ? bytes_.any() : time_;
    checks_.before(time);
    if (!disturbed && q_.size() == robot_->n_q()) q_ += checks_.step() * checks_.last();
    std::string violation;
    if ((odd & 0x40) != 0) {
      change_points();
      Points velocities_W(0, 3);
      if ((odd & 0x84) == 0x80) {
        velocities_W.resize(bytes_.one_in_eight() ? points_.rows() : 1, 3);
        for (auto row : velocities_W.rowwise()) row = any_vector().transpose();
      }
      const TickOutput& out = controller_.tick_known(time, q_, points_, goal_, velocities_W);
      const bool taken = points_.allFinite() && velocities_W.allFinite() &&
                         (points_.size() == 0 || points_.cwiseAbs().maxCoeff() <= 1e9);
      violation = checks_.after(q_, taken ? &points_ : nullptr, out);
      if (violation.empty() && checks_.blames_a_sensor())
        violation = "a tick on known points blames a sensor";
    } else {
      std::optional<double> stamp;
      if ((odd & 0x90) == 0x80) stamp = bytes_.mostly(time_ - 0.2, time_);
      make_scans();
      const TickOutput& out = controller_.tick(time, q_, scans_, goal_, late, stamp);
      const Points cloud = controller_.cloud_W();
      violation = checks_.after(q_, &cloud, out);
    }
    return violation;
  }

  void disturb_joints() {
    if (q_.size() != robot_->n_q() || !q_.allFinite()) {  // the bad reading is over
      q_ = trusted_q_;
      return;
    }
    trusted_q_ = q_;
    if (bytes_.byte() >= 248) {
      q_.resize(bytes_.below(kMaxJoints + 1));
      q_.setZero();
      return;
    }
    q_[bytes_.below(static_cast<int>(q_.size()))] = bytes_.mostly(-3.2, 3.2);
  }

  Vector3 any_vector() {
    const double x = bytes_.mostly(-2.0, 2.0), y = bytes_.mostly(-2.0, 2.0);
    return {x, y, bytes_.mostly(-2.0, 2.0)};
  }

  Pose any_goal() {
    Pose goal = Pose::Identity();
    goal.translation() = any_vector();
    if (bytes_.one_in_eight()) {
      goal.linear()(bytes_.below(3), bytes_.below(3)) = bytes_.any();
    } else {
      goal.linear() = Eigen::AngleAxisd(bytes_.between(-3.2, 3.2), Vector3::UnitY()) *
                      Eigen::AngleAxisd(bytes_.between(-3.2, 3.2), Vector3::UnitZ()).matrix();
    }
    return goal;
  }

  /// Known points: around the arm, on its surface (inside it, too), or anywhere at all.
  void change_points() {
    if (bytes_.byte() < 192) return;
    const int n = bytes_.below(12);
    points_.resize(n, 3);
    for (int i = 0; i < n; ++i) {
      if (bytes_.one_in_eight()) {
        points_.row(i) = any_vector();
      } else if (bytes_.one_in_eight() && q_.size() == robot_->n_q() && q_.allFinite()) {
        points_.row(i) = on_a_link().transpose();
      } else {
        points_.row(i) = bytes_.vector(1.2).transpose();
      }
    }
  }

  Vector3 on_a_link() {
    Posture posture = robot_->make_posture();
    robot_->update(q_, posture);
    const auto link = static_cast<std::size_t>(bytes_.below(robot_->n_links()));
    const Points& vertices = robot_->spec().links[link].vertices_L;
    const Vector3 vertex_L = vertices.row(bytes_.word() % vertices.rows());
    const double depth = bytes_.byte() < 128 ? 1.0 : bytes_.between(0.0, 1.5);
    return posture.T_WL[link] * Vector3(depth * vertex_L);
  }

  void make_scans() {
    scans_.clear();
    const int n = bytes_.below(2 * kMostSensors);
    for (int i = 0; i < n && sensors_ > 0; ++i) scans_.push_back(make_scan());
  }

  Scan make_scan() {
    Scan scan;
    const int kind = bytes_.byte();
    scan.sensor =
        kind >= 250 ? static_cast<int>(bytes_.finite() > 0.0) * 1000 - 1 : kind % sensors_;
    std::uint32_t& counter = counters_[static_cast<std::size_t>(kind % sensors_)];
    counter += kind >= 240 ? static_cast<std::uint32_t>(bytes_.word()) << 16U : 1U;
    scan.counter = counter;
    scan.stamp = kind >= 230 ? bytes_.mostly(time_ - 1.0, time_ + 0.1) : time_;
    const double depth = bytes_.between(0.02, 1.3);
    const double slope = bytes_.between(-0.02, 0.02);
    scan.status.fill(5);
    for (int zone = 0; zone < kZones; ++zone)
      scan.ranges[static_cast<std::size_t>(zone)] = depth + slope * zone;
    for (int bad = bytes_.byte() >= 128 ? bytes_.below(8) : 0; bad > 0; --bad) {
      const auto zone = static_cast<std::size_t>(bytes_.below(kZones));
      scan.status[zone] = bytes_.byte();
      scan.ranges[zone] = bytes_.any();
    }
    if (kind % 16 == 15) scan.status.fill(bytes_.byte());
    return scan;
  }

  static std::string at(int tick) { return "tick " + std::to_string(tick) + ": "; }

  Bytes bytes_;
  std::shared_ptr<Robot> robot_;
  int sensors_;
  ControllerConfig config_;
  Controller controller_;
  TickChecks checks_;
  double time_ = 0.0;
  JointVector q_, trusted_q_;
  Pose goal_ = Pose::Identity();
  Points points_;
  std::vector<Scan> scans_;
  std::array<std::uint32_t, kMostSensors> counters_;
};

inline TickRun run_ticks(const std::uint8_t* data, std::size_t size) {
  return TickHarness(Bytes(data, size)).run();
}

}  // namespace proxcgal::fuzz
