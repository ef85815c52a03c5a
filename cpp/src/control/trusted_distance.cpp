#include "trusted_distance.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/frames.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kBelieved = 0.1;   // [s] inside d_min: longer than one scan lasts
constexpr double kTouching = 1e-9;  // [m] nearer than this no normal is left

}  // namespace

TrustedDistance::TrustedDistance(const Robot& robot, const ControllerConfig& config)
    : robot_(robot),
      fresh_within_(config.monitor.fresh_within),
      approach_speed_(config.monitor.approach_speed) {
  retune(config.tasks);
}

void TrustedDistance::retune(const std::vector<TaskSpec>& tasks) {
  avoidance_.reset();
  for (const TaskSpec& task : tasks) {
    const auto* spec = std::get_if<Avoidance>(&task);
    if (spec != nullptr && !avoidance_) avoidance_ = *spec;
  }
}

Vector3 TrustedDistance::out_of_link(const ClosestPair& pair, const Posture& posture) const {
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(pair.link)];
  return (T_WL * robot_.tree(pair.link).bounds().center - pair.obstacle_W).normalized();
}

void TrustedDistance::of_known(const Posture& posture, TickOutput& out) {
  out.trusted_distance = out.pair_distance();
  if (!out.pair) return;
  const Vector3 apart = out.pair->surface_W - out.pair->obstacle_W;
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(out.pair->link)];
  const bool inside = robot_.tree(out.pair->link).inside(into(T_WL, out.pair->obstacle_W));
  if (inside) out.trusted_distance = -out.pair->distance;
  signed_distance_ = out.trusted_distance;
  // Where the point is on the surface, and no normal held before: out from the link's centre.
  if (apart.norm() > kTouching) {
    outward_W_ = apart.normalized() * (inside ? -1.0 : 1.0);
  } else if (outward_W_.isZero()) {
    outward_W_ = out_of_link(*out.pair, posture);
  }
}

void TrustedDistance::of_sensed(double time, const Posture& posture, const Perception& perception,
                                ControlPoints& control_points, TickOutput& out, Monitor& monitor) {
  out.trusted_distance = out.pair_distance();
  const PointsRef cloud_W = perception.cloud_W();
  for (std::size_t sensor = 0; sensor < perception.freshness().sensors(); ++sensor) {
    const double late = perception.freshness().age(sensor, time) - fresh_within_;
    const auto [begin, count] = perception.cloud_rows(sensor);
    if (!(late > 0.0) || count == 0) continue;
    const double shorter = approach_speed_ * late;
    ClosestPair pair = control_points.nearest_of(robot_, posture, cloud_W.middleRows(begin, count),
                                                 out.trusted_distance + shorter);
    if (!pair.found()) continue;
    pair.point += static_cast<int>(begin);
    out.pair = pair;
    out.trusted_distance = std::max(pair.distance - shorter, 0.0);
  }
  if (!out.pair) return;
  signed_distance_ = out.pair->distance;
  const Vector3 apart = out.pair->surface_W - out.pair->obstacle_W;
  if (!perception.in_contact(perception.origins()[static_cast<std::size_t>(out.pair->point)])) {
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(out.pair->link)];
    const bool inside = robot_.tree(out.pair->link).inside(into(T_WL, out.pair->obstacle_W));
    if (inside) out.trusted_distance = signed_distance_ = -out.pair->distance;
    if (apart.norm() > kTouching) outward_W_ = apart.normalized() * (inside ? -1.0 : 1.0);
    return;
  }
  monitor.add({.reason = Reason::kContact, .link = out.pair->link});
  // Taken for body, so as near as noise: whether the point measured is in or out of the surface,
  // the normal that held before does.
  if (apart.dot(outward_W_) < 0.0) out.trusted_distance = signed_distance_ = -out.pair->distance;
}

ControlPair TrustedDistance::control(const TickOutput& out, const Vector3& velocity_W) const {
  return {.link = out.pair->link,
          .control_W = out.pair->surface_W,
          .obstacle_W = out.pair->obstacle_W,
          .obstacle_velocity_W = velocity_W,
          .distance = signed_distance_,
          .fallback_normal_W = outward_W_};
}

void TrustedDistance::watch(double time, const TickOutput& out, Perception& perception) {
  // A payload that is stuck is no obstacle that was seen there: it must not outlive its fault.
  // What is remembered was seen before.
  const bool doubtful =
      out.pair && !out.pair_remembered && out.pair_origin.sensor >= 0 &&
      perception.freshness().suspect(static_cast<std::size_t>(out.pair_origin.sensor));
  if (!inside(out) || doubtful) near_since_ = time;
  const bool believed = time - near_since_ > kBelieved;
  perception.hold(believed && out.pair_remembered ? out.pair->point : -1);
  // No zone shows what is remembered: there is none to watch.
  if (believed && !out.pair_remembered) {
    perception.watch({out.pair_origin, out.pair->obstacle_W, perception.stamp(out.pair->point)});
  } else {
    perception.watch({});
  }
}

}  // namespace proxcgal::detail
