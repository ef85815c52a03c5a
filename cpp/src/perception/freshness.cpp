#include "freshness.hpp"

#include <algorithm>
#include <map>

#include "monotonic_clock.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kOldestStamp = 0.5;  // [s] an older scan says nothing of now
constexpr int kTelling = 4;  // zones with a target: noise makes two equal payloads unlikely

/// Sensors of one array carry one name up to its last '/'.
std::string array_name(const Mount& mount) { return mount.name.substr(0, mount.name.rfind('/')); }

}  // namespace

Freshness::Freshness(const Skin& skin, const MonitorConfig& config)
    : config_(config), packets_(skin.mounts.size()) {
  std::map<std::string, std::vector<std::size_t>> by_name;
  for (std::size_t s = 0; s < skin.mounts.size(); ++s)
    by_name[array_name(skin.mounts[s])].push_back(s);
  for (const auto& [name, sensors] : by_name) {
    // A single sensor is no array: its silence slows by direction.
    if (sensors.size() > 1) arrays_.push_back(sensors);
  }
}

bool Freshness::accept(double time, double delay, const Scan& scan, Monitor& monitor) {
  Finding refused{.reason = Reason::kScanRefused, .sensor = scan.sensor};
  if (scan.sensor < 0 || static_cast<std::size_t>(scan.sensor) >= packets_.size()) {
    monitor.add(refused);
    return false;
  }
  Packets& packets = packets_[static_cast<std::size_t>(scan.sensor)];
  // The counter may wrap: what matters is which way it moved.
  const bool advanced =
      !packets.counted || static_cast<std::int32_t>(scan.counter - packets.counter) > 0;
  const double stamp = whole_us(scan.stamp + delay);
  refused.age = time - stamp;
  if (!advanced || !(stamp <= time + kClockResolution) || !(refused.age <= kOldestStamp)) {
    monitor.add(refused);
    return false;
  }
  packets.counted = true;
  packets.counter = scan.counter;
  return true;
}

void Freshness::note(double time, const Scan& scan, int targets, bool usable) {
  Packets& packets = packets_[static_cast<std::size_t>(scan.sensor)];
  const bool same = scan.ranges == packets.ranges && scan.status == packets.status;
  packets.repeats = same && targets >= kTelling ? packets.repeats + 1 : 0;
  packets.ranges = scan.ranges;
  packets.status = scan.status;
  if (!usable) return;
  packets.seen = true;
  packets.received = time;
}

double Freshness::age(std::size_t sensor, double time) const {
  return packets_[sensor].seen ? time - packets_[sensor].received : kInfinity;
}

double Freshness::blind_for(std::size_t sensor, double time) const {
  return suspect(packets_[sensor]) ? kInfinity : age(sensor, time);
}

void Freshness::check(double time, Monitor& monitor) const {
  // A skin without sensors sees nothing: to the arm that is the same as silence.
  double youngest = kInfinity;
  for (std::size_t s = 0; s < packets_.size(); ++s) {
    const auto sensor = static_cast<int>(s);
    const double old = age(s, time);
    youngest = std::min(youngest, old);
    if (suspect(packets_[s])) {
      monitor.add({.reason = Reason::kSensorSuspect,
                   .sensor = sensor,
                   .age = old,
                   .count = packets_[s].repeats});
    }
    if (old > config_.degraded_after)
      monitor.add({.reason = Reason::kSensorSilent, .sensor = sensor, .age = old});
  }
  if (youngest > config_.hold_after) {
    monitor.add({.reason = Reason::kAllSensorsSilent, .age = youngest});
  } else {
    check_arrays(time, monitor);
  }
}

void Freshness::check_arrays(double time, Monitor& monitor) const {
  for (const std::vector<std::size_t>& array : arrays_) {
    double youngest = kInfinity;
    for (const std::size_t s : array) youngest = std::min(youngest, age(s, time));
    if (!(youngest > config_.hold_after)) continue;
    monitor.add({.reason = Reason::kArraySilent,
                 .sensor = static_cast<int>(array.front()),
                 .age = youngest,
                 .count = static_cast<int>(array.size())});
  }
}

}  // namespace proxcgal::detail
