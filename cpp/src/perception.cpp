#include "perception.hpp"

#include <algorithm>
#include <cmath>

#include "stopwatch.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kStampSlack = 1e-3;  // [s] a stamp this far in the future is clock resolution
constexpr double kOldestStamp = 0.5;  // [s] an older scan says nothing of now
// [m] from scan to scan, at most: what is watched comes near, it does not jump. Farther off it is
// another thing that came into the zone's view, the arm itself as a rule.
constexpr double kNearEnough = 0.08;
constexpr int kTelling = 4;  // zones with a target: noise makes two equal payloads unlikely

/// Sensors of one array carry one name up to its last '/': rows of equal arrays are equal.
std::string array_name(const Mount& mount) {
  const auto end = mount.name.rfind('/');
  return end == std::string::npos ? mount.name : mount.name.substr(0, end);
}
int array_of(const Skin& skin, const Mount& mount) {
  std::vector<std::string> names;
  for (const Mount& other : skin.mounts) {
    if (std::find(names.begin(), names.end(), array_name(other)) == names.end())
      names.push_back(array_name(other));
  }
  return static_cast<int>(std::find(names.begin(), names.end(), array_name(mount)) - names.begin());
}

}  // namespace

void JointHistory::push(double time, const JointVector& q) {
  time_[count_ % kKept] = time;
  q_[count_ % kKept] = q;
  ++count_;
}

JointVector JointHistory::at(double time) const {
  const std::size_t kept = std::min(count_, kKept);
  if (time >= t(0)) return q(0);
  for (std::size_t back = 1; back < kept; ++back) {
    if (time < t(back)) continue;
    const double span = t(back - 1) - t(back);
    const double part = span > 0.0 ? (time - t(back)) / span : 0.0;
    return q(back) + part * (q(back - 1) - q(back));
  }
  return q(kept - 1);
}

Perception::Perception(std::shared_ptr<const Robot> robot, const Skin& skin,
                       const FilterConfig& config, Method method)
    : robot_(std::move(robot)),
      sense_(skin.model),
      config_(config),
      method_(method),
      posture_(robot_->make_posture()) {
  for (int link = 0; link < robot_->n_links(); ++link)
    mesh_error_ = std::max(mesh_error_, robot_->mesh_error(link));
  for (const Mount& mount : skin.mounts) {
    Sensor sensor;
    sensor.link = robot_->link_row(mount.link);
    sensor.T_LS = mount.T_LS;
    for (auto& ranges : sensor.past) ranges.fill(kInfinity);
    sensor.array = array_of(skin, mount);
    arrays_ = std::max(arrays_, sensor.array + 1);
    sensors_.push_back(sensor);
  }
  const auto room = sensors_.size() * kZones;
  staged_.sensor.resize(room);
  staged_.zone.resize(room);
  staged_.tolerance.resize(room);
  staged_.range.resize(room);
  staged_.keep = std::make_unique<bool[]>(room);
  for (Points* points : {&staged_.origins_W, &staged_.points_W, &cloud_, &raw_}) {
    points->setZero(static_cast<Eigen::Index>(room), 3);
  }
  origins_.resize(room);
}

bool Perception::accept(double time, double delay, const Scan& scan, Monitor& monitor) {
  Finding refused;
  refused.reason = Reason::kScanRefused;
  refused.sensor = scan.sensor;
  if (scan.sensor < 0 || scan.sensor >= sensors()) {
    monitor.add(refused);
    return false;
  }
  Sensor& sensor = sensors_[static_cast<std::size_t>(scan.sensor)];
  // The counter may wrap: what matters is which way it moved.
  const bool advanced =
      !sensor.counted || static_cast<std::int32_t>(scan.counter - sensor.counter) > 0;
  const double stamp = scan.stamp + delay;
  refused.age = time - stamp;
  if (!advanced || !(stamp <= time + kStampSlack) || !(refused.age <= kOldestStamp)) {
    monitor.add(refused);
    return false;
  }
  sensor.counted = true;
  sensor.counter = scan.counter;
  return true;
}

void Perception::update(double time, double delay, const JointVector& q,
                        std::span<const Scan> scans, Monitor& monitor) {
  history_.push(time, q);
  steps_ = kSearchSteps;
  sense_us = filter_us = 0.0;
  if (scans.empty()) return;
  double placed = std::numeric_limits<double>::quiet_NaN();  // stamp that `posture_` is at
  staged_.count = 0;
  for (const Scan& scan : scans) {
    Stopwatch watch(timings);
    if (!accept(time, delay, scan, monitor)) continue;
    // One filter call for all scans of one stamp; a sensor twice in a batch needs two.
    if (scan.stamp != placed || sensors_[static_cast<std::size_t>(scan.sensor)].staged) {
      sense_us += watch.lap_us();
      filter(monitor);
      filter_us += watch.lap_us();
      placed = scan.stamp;
      robot_->update(history_.at(scan.stamp + delay), posture_);
    }
    stage(time, scan, monitor);
    sense_us += watch.lap_us();
  }
  Stopwatch watch(timings);
  filter(monitor);
  gather();
  filter_us += watch.lap_us();
}

void Perception::stage(double time, const Scan& scan, Monitor& monitor) {
  SensedPoints sensed;
  sense_(scan, sensed);
  Sensor& sensor = sensors_[static_cast<std::size_t>(scan.sensor)];
  if (sensed.invalid > 0) {
    Finding finding;
    finding.reason = Reason::kZoneInvalid;
    finding.sensor = scan.sensor;
    finding.zone = sensed.first_invalid_zone;
    finding.count = sensed.invalid;
    monitor.add(finding);
  }
  const bool same = scan.ranges == sensor.ranges && scan.status == sensor.status;
  sensor.repeats = same && sensed.count >= kTelling ? sensor.repeats + 1 : 0;
  sensor.ranges = scan.ranges;
  sensor.status = scan.status;
  // A scan without one usable zone tells nothing: the sensor's last cloud stays, and its age grows.
  if (sensed.invalid == kZones) return;
  sensor.seen = true;
  sensor.received = time;
  const Eigen::Index before = staged_.count;
  const Pose T_WS = posture_.T_WL[static_cast<std::size_t>(sensor.link)] * sensor.T_LS;
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
    Finding finding;
    finding.reason = Reason::kWorkBounded;
    monitor.add(finding);
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
      in_contact_ = staged_.keep[row] = moved.norm() < kNearEnough;
    }
    if (!staged_.keep[row] || !confirmed(sensor, ranges, zone, staged_.tolerance[row])) continue;
    const auto at = static_cast<std::size_t>(sensor.n_kept++);
    sensor.kept_W[at] = staged_.points_W.row(i).transpose();
    sensor.zone[at] = static_cast<std::uint8_t>(zone);
  }
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
  for (int id = 0; id < sensors(); ++id) {
    Sensor& sensor = sensors_[static_cast<std::size_t>(id)];
    sensor.cloud_begin = n_cloud_;
    for (int i = 0; i < sensor.n_kept; ++i) {
      origins_[static_cast<std::size_t>(n_cloud_)] = {id, sensor.zone[static_cast<std::size_t>(i)]};
      cloud_.row(n_cloud_++) = sensor.kept_W[static_cast<std::size_t>(i)].transpose();
    }
  }
}

Eigen::Map<const Points> Perception::raw_cloud_W() const {
  Eigen::Index n = 0;
  for (const Sensor& sensor : sensors_) {
    for (int i = 0; i < sensor.n_raw; ++i)
      raw_.row(n++) = sensor.raw_W[static_cast<std::size_t>(i)].transpose();
  }
  return {raw_.data(), n, 3};
}

double Perception::age(std::size_t sensor, double time) const {
  return sensors_[sensor].seen ? time - sensors_[sensor].received : kInfinity;
}

double Perception::blind_for(std::size_t sensor, double time, const MonitorConfig& config) const {
  const bool suspect =
      config.suspect_repeats > 0 && sensors_[sensor].repeats >= config.suspect_repeats;
  return suspect ? kInfinity : age(sensor, time);
}

void Perception::check_freshness(double time, const MonitorConfig& config, Monitor& monitor) const {
  // A skin without sensors sees nothing: to the arm that is the same as silence.
  double youngest = kInfinity;
  for (std::size_t id = 0; id < sensors_.size(); ++id) {
    const double old = age(id, time);
    youngest = std::min(youngest, old);
    const int repeats = sensors_[id].repeats;
    if (config.suspect_repeats > 0 && repeats >= config.suspect_repeats) {
      Finding finding;
      finding.reason = Reason::kSensorSuspect;
      finding.sensor = static_cast<int>(id);
      finding.age = old;
      finding.count = repeats;
      monitor.add(finding);
    }
    if (!(old > config.degraded_after)) continue;
    Finding finding;
    finding.reason = Reason::kSensorSilent;
    finding.sensor = static_cast<int>(id);
    finding.age = old;
    monitor.add(finding);
  }
  if (youngest > config.hold_after) {
    Finding finding;
    finding.reason = Reason::kAllSensorsSilent;
    finding.age = youngest;
    monitor.add(finding);
    return;
  }
  for (int array = 0; array < arrays_; ++array) {
    Finding finding;
    finding.reason = Reason::kArraySilent;
    finding.age = kInfinity;
    finding.count = 0;
    for (std::size_t id = 0; id < sensors_.size(); ++id) {
      if (sensors_[id].array != array) continue;
      if (finding.count++ == 0) finding.sensor = static_cast<int>(id);
      finding.age = std::min(finding.age, age(id, time));
    }
    // A single sensor is no array: its silence slows by direction.
    if (finding.count > 1 && finding.age > config.hold_after) monitor.add(finding);
  }
}

}  // namespace proxcgal::detail
