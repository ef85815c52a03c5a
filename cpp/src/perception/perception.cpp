#include "perception.hpp"

#include <algorithm>
#include <cmath>

#include "monotonic_clock.hpp"
#include "stopwatch.hpp"

namespace proxcgal::detail {
namespace {

// [m/s] and [m] from scan to scan, at most: what is watched comes near, it does not jump. Farther
// off it is another thing that came into the zone's view, the arm itself as a rule. The speed is
// that of a hand (ISO 13855).
constexpr double kFastest = 2.0;
constexpr double kNoise = 0.03;
constexpr double kLongest = 0.2;  // [s] between two scans of a zone that is watched

}  // namespace

Perception::Perception(std::shared_ptr<const Robot> robot, const Skin& skin,
                       const PerceptionConfig& config)
    : timings(config.timings),
      robot_(std::move(robot)),
      sense_(skin.model),
      config_(config.filter),
      method_(config.method),
      freshness_(skin, config.monitor),
      posture_(robot_->make_posture()) {
  for (int link = 0; link < robot_->n_links(); ++link)
    mesh_error_ = std::max(mesh_error_, robot_->mesh_error(link));
  for (const Mount& mount : skin.mounts) {
    Sensor sensor;
    sensor.link = robot_->link_row(mount.link);
    sensor.T_LS = mount.T_LS;
    for (auto& ranges : sensor.past) ranges.fill(kInfinity);
    sensors_.push_back(sensor);
  }
  const auto room = sensors_.size() * kZones;
  staged_.sensor.resize(room);
  staged_.zone.resize(room);
  staged_.tolerance.resize(room);
  staged_.sigma.resize(room);
  staged_.range.resize(room);
  staged_.keep = std::make_unique<bool[]>(room);
  for (Points* points : {&staged_.origins_W, &staged_.points_W, &raw_}) {
    points->setZero(static_cast<Eigen::Index>(room), 3);
  }
  std::size_t remembered = 0;
  if (config.memory && config.memory->memory_s > 0.0) {
    const SensorModel& model = skin.model;
    const ViewModel view{.field_of_view = model.field_of_view,
                         .sigma_floor = model.sigma_floor,
                         .sigma_ratio = model.sigma_ratio,
                         .sigmas = config_.sigmas};
    memory_.emplace(*config.memory, view, sensors_.size());
    remembered = static_cast<std::size_t>(config.memory->max_points);
    body_ = std::make_unique<bool[]>(remembered);
  }
  if (config.motion) motion_.emplace(*config.motion, sensors_.size());
  cloud_.setZero(static_cast<Eigen::Index>(room + remembered), 3);
  origins_.resize(room + remembered);
  stamps_.resize(room + remembered);
  sigmas_.resize(room + remembered);
}

void Perception::update(double time, double delay, const JointVector& q,
                        std::span<const Scan> scans, Monitor& monitor) {
  history_.push(time, q);
  steps_ = kSearchSteps;
  sense_us = filter_us = memory_us = 0.0;
  if (scans.empty()) return;
  double placed = std::numeric_limits<double>::quiet_NaN();  // stamp that `posture_` is at
  staged_.count = 0;
  for (const Scan& scan : scans) {
    Stopwatch watch(timings);
    if (!freshness_.accept(time, delay, scan, monitor)) continue;
    // One filter call for all scans of one stamp; a sensor twice in a batch needs two.
    if (scan.stamp != placed || sensors_[static_cast<std::size_t>(scan.sensor)].staged) {
      sense_us += watch.lap_us();
      filter(monitor);
      filter_us += watch.lap_us();
      placed = scan.stamp;
      robot_->update(history_.at(whole_us(scan.stamp + delay)), posture_);
    }
    let_go(static_cast<std::size_t>(scan.sensor));
    stage(time, scan, whole_us(scan.stamp + delay), monitor);
    sense_us += watch.lap_us();
  }
  Stopwatch watch(timings);
  filter(monitor);
  filter_us += watch.lap_us();
  for (std::size_t id = 0; (memory_ || motion_) && id < sensors_.size(); ++id) let_go(id);
  memory_us += watch.lap_us();
  gather();
  filter_us += watch.lap_us();
}

void Perception::stage(double time, const Scan& scan, double stamp, Monitor& monitor) {
  SensedPoints sensed;
  sense_(scan, sensed);
  Sensor& sensor = sensors_[static_cast<std::size_t>(scan.sensor)];
  if (sensed.invalid > 0) {
    monitor.add({.reason = Reason::kZoneInvalid,
                 .sensor = scan.sensor,
                 .zone = sensed.first_invalid_zone,
                 .count = sensed.invalid});
  }
  // A scan without one usable zone tells nothing: the sensor's last cloud stays, and its age grows.
  const bool usable = sensed.invalid < kZones;
  freshness_.note(time, scan, sensed.targets, usable);
  if (!usable) return;
  const Eigen::Index before = staged_.count;
  const Pose T_WS = posture_.T_WL[static_cast<std::size_t>(sensor.link)] * sensor.T_LS;
  if (memory_ || motion_) look(scan, stamp, T_WS, sensor);
  sensor.stamp = stamp;
  sensor.n_raw = sensor.n_kept = 0;
  if (config_.confirmation != Confirmation::kOff) {
    std::rotate(sensor.past.begin(), sensor.past.end() - 1, sensor.past.end());
    sensor.past[0].fill(kInfinity);
  }
  for (int i = 0; i < sensed.count; ++i) {
    const auto from = static_cast<std::size_t>(i);
    const Vector3 point_W = T_WS * sensed.point_S[from];
    if (point_W.z() < config_.z_min) continue;  // floor, pedestal and mounts are no obstacle
    sensor.raw_W[static_cast<std::size_t>(sensor.n_raw++)] = point_W;
    const auto row = static_cast<std::size_t>(staged_.count);
    staged_.sensor[row] = scan.sensor;
    staged_.zone[row] = sensed.zone[from];
    staged_.range[row] = sensed.range[from];
    staged_.sigma[row] = sensed.sigma[from];
    staged_.tolerance[row] =
        std::max(config_.tolerance, config_.sigmas * sensed.sigma[from]) + mesh_error_;
    staged_.origins_W.row(staged_.count) = T_WS.translation().transpose();
    staged_.points_W.row(staged_.count) = point_W.transpose();
    ++staged_.count;
  }
  sensor.staged = staged_.count > before;
}

void Perception::filter(Monitor& monitor) {
  if (staged_.count == 0) return;
  const auto n = static_cast<std::size_t>(staged_.count);
  const std::span<bool> keep_mask(staged_.keep.get(), n);
  const std::span<const double> tolerance(staged_.tolerance.data(), n);
  const auto points = staged_.points_W.topRows(staged_.count);
  std::fill(keep_mask.begin(), keep_mask.end(), true);
  const bool complete =
      config_.surface_margin &&
      remove_near_surface(*robot_, posture_, points, tolerance, keep_mask, &steps_);
  if (config_.surface_margin && !complete) {
    monitor.add({.reason = Reason::kWorkBounded});
  }
  // Algorithm 1 drops only points that lie within their tolerance of a surface: where the margin
  // has dropped all of those, it finds nothing more, and only the literal form is asked still.
  if (!complete || method_ == Method::kPaper) {
    remove_body(*robot_, posture_, staged_.origins_W.topRows(staged_.count), points, tolerance,
                config_.min_hit, method_, keep_mask);
  }
  // Rows of one sensor stand together.
  for (int begin = 0; begin < static_cast<int>(n);) {
    const int id = staged_.sensor[static_cast<std::size_t>(begin)];
    int end = begin;
    while (end < static_cast<int>(n) && staged_.sensor[static_cast<std::size_t>(end)] == id) ++end;
    keep(sensors_[static_cast<std::size_t>(id)], begin, end);
    sensors_[static_cast<std::size_t>(id)].staged = false;
    begin = end;
  }
  staged_.count = 0;
}

void Perception::keep(Sensor& sensor, int begin, int end) {
  std::array<double, kZones>& ranges = sensor.past[0];
  for (int i = begin; config_.confirmation != Confirmation::kOff && i < end; ++i) {
    const auto row = static_cast<std::size_t>(i);
    if (staged_.keep[row]) ranges[static_cast<std::size_t>(staged_.zone[row])] = staged_.range[row];
  }
  const bool watched = watched_.origin.sensor == staged_.sensor[static_cast<std::size_t>(begin)];
  if (watched) in_contact_ = false;
  for (int i = begin; i < end; ++i) {
    const auto row = static_cast<std::size_t>(i);
    const int zone = staged_.zone[row];
    if (watched && zone == watched_.origin.zone && !staged_.keep[row]) {
      const Vector3 moved = staged_.points_W.row(i).transpose() - watched_.obstacle_W;
      const double since = std::clamp(sensor.stamp - watched_.stamp, 0.0, kLongest);
      in_contact_ = staged_.keep[row] = moved.norm() < kNoise + kFastest * since;
    }
    if (!staged_.keep[row] || !confirmed(sensor, ranges, zone, staged_.tolerance[row])) continue;
    const auto at = static_cast<std::size_t>(sensor.n_kept++);
    sensor.kept_W[at] = staged_.points_W.row(i).transpose();
    sensor.zone[at] = static_cast<std::uint8_t>(zone);
    sensor.tolerance[at] = staged_.tolerance[row];
    sensor.sigma[at] = staged_.sigma[row];
    sensor.view.obstacle[static_cast<std::size_t>(zone)] =
        sensor.view.empty_to[static_cast<std::size_t>(zone)];
  }
}

/// What the scan says of the space before its sensor, and what of its last scan is to leave.
void Perception::look(const Scan& scan, double stamp, const Pose& T_WS, Sensor& sensor) {
  sensor.leaves = true;
  sensor.n_left = sensor.doubtful ? 0 : sensor.n_kept;
  sensor.doubtful = freshness_.suspect(static_cast<std::size_t>(scan.sensor));
  for (int i = 0; i < sensor.n_left; ++i) {
    const auto at = static_cast<std::size_t>(i);
    sensor.left[at] = {
        sensor.kept_W[at], sensor.stamp, sensor.tolerance[at], {scan.sensor, sensor.zone[at]}};
  }
  sensor.view.T_WS = T_WS;
  sensor.view.stamp = stamp;
  sensor.view.obstacle.fill(0.0F);
  for (int zone = 0; zone < kZones; ++zone) {
    const auto at = static_cast<std::size_t>(zone);
    double end = 0.0;
    switch (sense_.classify(scan.ranges[at], scan.status[at])) {
      case ZoneState::kTarget:
      case ZoneState::kUncertain:
        end = scan.ranges[at];
        break;
      case ZoneState::kEmpty:
        end = sense_.farthest(zone);
        break;
      case ZoneState::kInvalid:
        break;
    }
    sensor.view.empty_to[at] = static_cast<float>(end);
  }
}

/// Once the filter has judged a sensor's new scan: its points go to motion, those of the scan
/// before to memory.
void Perception::let_go(std::size_t id) {
  Sensor& sensor = sensors_[id];
  if (!sensor.leaves) return;
  sensor.leaves = false;
  // A payload that is stuck shows neither what is there nor what is gone.
  if (sensor.doubtful) return;
  if (motion_) {
    motion_->see(sensor.stamp,
                 std::span(sensor.kept_W).first(static_cast<std::size_t>(sensor.n_kept)));
  }
  if (!memory_) return;
  memory_->leave(std::span(sensor.left).first(static_cast<std::size_t>(sensor.n_left)), sensor.view,
                 *robot_, posture_, &steps_);
  memory_->see(id, sensor.view);
}

void Perception::remember(double time, const Posture& posture, Monitor& monitor) {
  if (!memory_) return;
  Stopwatch watch(timings);
  memory_->update(time);
  // What was no body at its stamp may lie where the arm is now: noise, or the arm itself unseen.
  const auto points_W = memory_->points_W();
  const auto n = static_cast<std::size_t>(points_W.rows());
  const std::span<bool> body(body_.get(), n);
  std::fill(body.begin(), body.end(), true);
  const bool complete =
      remove_near_surface(*robot_, posture, points_W, memory_->tolerances(), body, &steps_);
  if (!complete) monitor.add({.reason = Reason::kWorkBounded});
  for (bool& mark : body) mark = !mark;
  if (memory_->held() >= 0) body[static_cast<std::size_t>(memory_->held())] = false;
  memory_->forget(body);
  if (memory_->version() != appended_) append();
  memory_us += watch.lap_us();
}

/// What is remembered, behind what is seen.
void Perception::append() {
  const auto points_W = memory_->points_W();
  const Eigen::Index n = points_W.rows();
  cloud_.middleRows(n_seen_, n) = points_W;
  std::copy_n(memory_->origins().begin(), n, origins_.begin() + n_seen_);
  std::copy_n(memory_->stamps().begin(), n, stamps_.begin() + n_seen_);
  const double share = 1.0 / std::max(config_.sigmas, 1.0);  // of a tolerance
  std::transform(memory_->tolerances().begin(), memory_->tolerances().begin() + n,
                 sigmas_.begin() + n_seen_,
                 [&](double tolerance) { return share * (tolerance - mesh_error_); });
  n_cloud_ = n_seen_ + n;
  appended_ = memory_->version();
}

bool Perception::confirmed(const Sensor& sensor, const std::array<double, kZones>& ranges, int zone,
                           double tolerance) const {
  const double range = ranges[static_cast<std::size_t>(zone)];
  const auto similar = [&](double other) { return std::abs(other - range) <= 2.0 * tolerance; };
  switch (config_.confirmation) {
    case Confirmation::kOff:
      return true;
    case Confirmation::kZones:
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int x = zone % 8 + dx, y = zone / 8 + dy;
          if ((dx != 0 || dy != 0) && x >= 0 && x < 8 && y >= 0 && y < 8 &&
              similar(ranges[static_cast<std::size_t>(8 * y + x)])) {
            return true;
          }
        }
      }
      return false;
    case Confirmation::kScans:
      return similar(sensor.past[1][static_cast<std::size_t>(zone)]) ||
             similar(sensor.past[2][static_cast<std::size_t>(zone)]);
  }
  return true;
}

void Perception::gather() {
  n_cloud_ = 0;
  int id = -1;
  for (Sensor& sensor : sensors_) {
    ++id;
    sensor.cloud_begin = n_cloud_;
    for (int i = 0; i < sensor.n_kept; ++i) {
      origins_[static_cast<std::size_t>(n_cloud_)] = {id, sensor.zone[static_cast<std::size_t>(i)]};
      stamps_[static_cast<std::size_t>(n_cloud_)] = sensor.stamp;
      sigmas_[static_cast<std::size_t>(n_cloud_)] = sensor.sigma[static_cast<std::size_t>(i)];
      cloud_.row(n_cloud_++) = sensor.kept_W[static_cast<std::size_t>(i)].transpose();
    }
  }
  n_seen_ = n_cloud_;
  if (memory_) append();
}

Eigen::Map<const Points> Perception::raw_cloud_W() const {
  Eigen::Index n = 0;
  for (const Sensor& sensor : sensors_) {
    for (int i = 0; i < sensor.n_raw; ++i)
      raw_.row(n++) = sensor.raw_W[static_cast<std::size_t>(i)].transpose();
  }
  return {raw_.data(), n, 3};
}

void Perception::watch(const Watched& watched) {
  const PointOrigin &now = watched.origin, &before = watched_.origin;
  if (now.sensor != before.sensor || now.zone != before.zone) in_contact_ = false;
  watched_ = watched;
}

}  // namespace proxcgal::detail
