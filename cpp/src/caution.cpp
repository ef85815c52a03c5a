#include "caution.hpp"

#include <algorithm>
#include <cmath>

#include "frames.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kBelieved = 0.1;   // [s] inside d_min: longer than one scan lasts
constexpr double kTouching = 1e-9;  // [m] nearer than this no normal is left
constexpr double kInto = 0.02;      // [m/s] slower motion into the unseen holds nothing up

std::array<Vector3, 5> view_directions(const SensorModel& model) {
  const double edge = std::tan(0.5 * model.field_of_view);
  std::array<Vector3, 5> directions{Vector3(0, 0, 1), Vector3(edge, edge, 1),
                                    Vector3(-edge, edge, 1), Vector3(edge, -edge, 1),
                                    Vector3(-edge, -edge, 1)};
  for (Vector3& direction : directions) direction.normalize();
  return directions;
}

}  // namespace

Caution::Caution(const Robot& robot, const Skin& skin, const ControllerConfig& config)
    : robot_(robot),
      config_(config.monitor),
      whole_body_(config.control_point == ControlPoint::kWholeBody),
      view_S_(view_directions(skin.model)) {
  retune(config.tasks);
}

void Caution::retune(const std::vector<TaskSpec>& tasks) {
  avoidance_.reset();
  for (const TaskSpec& task : tasks) {
    const auto* spec = std::get_if<Avoidance>(&task);
    if (spec != nullptr && !avoidance_) avoidance_ = *spec;
  }
}

Vector3 Caution::out_of_link(const ClosestPair& pair, const Posture& posture) const {
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(pair.link)];
  return (T_WL * robot_.tree(pair.link).bounds().center - pair.obstacle_W).normalized();
}

void Caution::trust_known(const Posture& posture, TickOutput& out) {
  out.trusted_distance = out.pair_distance();
  if (!out.pair) return;
  const Vector3 apart = out.pair->surface_W - out.pair->obstacle_W;
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(out.pair->link)];
  const bool inside = robot_.tree(out.pair->link).inside(into(T_WL, out.pair->obstacle_W));
  if (inside) out.trusted_distance = -out.pair->distance;
  // Where the point is on the surface, and no normal held before: out from the link's centre.
  if (apart.norm() > kTouching) {
    outward_W_ = apart.normalized() * (inside ? -1.0 : 1.0);
  } else if (outward_W_.isZero()) {
    outward_W_ = out_of_link(*out.pair, posture);
  }
}

void Caution::trust_sensed(double time, const Posture& posture, const Perception& perception,
                           ControlPoints& control_points, TickOutput& out, Monitor& monitor) {
  out.trusted_distance = out.pair_distance();
  const PointsRef cloud_W = perception.cloud_W();
  for (std::size_t sensor = 0; sensor < perception.freshness().sensors(); ++sensor) {
    const double late = perception.freshness().age(sensor, time) - config_.fresh_within;
    const auto [begin, count] = perception.cloud_rows(sensor);
    if (!(late > 0.0) || count == 0) continue;
    const double shorter = config_.approach_speed * late;
    ClosestPair pair = control_points.nearest_of(robot_, posture, cloud_W.middleRows(begin, count),
                                                 out.trusted_distance + shorter);
    if (!pair.found()) continue;
    pair.point += static_cast<int>(begin);
    out.pair = pair;
    out.trusted_distance = std::max(pair.distance - shorter, 0.0);
  }
  if (!out.pair) return;
  const Vector3 apart = out.pair->surface_W - out.pair->obstacle_W;
  if (!perception.in_contact()) {
    if (apart.norm() > kTouching) outward_W_ = apart.normalized();
    return;
  }
  monitor.add({.reason = Reason::kContact, .link = out.pair->link});
  // Taken for body, so as near as noise: whether the point measured is in or out of the surface,
  // the normal that held before does.
  if (apart.dot(outward_W_) < 0.0) out.trusted_distance = -out.pair->distance;
}

ControlPair Caution::control(const TickOutput& out, const Vector3& velocity_W) const {
  return {.link = out.pair->link,
          .control_W = out.pair->surface_W,
          .obstacle_W = out.pair->obstacle_W,
          .obstacle_velocity_W = velocity_W,
          .distance = out.trusted_distance,
          .fallback_normal_W = outward_W_};
}

void Caution::watch(double time, const TickOutput& out, Perception& perception) {
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
    perception.watch({out.pair_origin, out.pair->obstacle_W});
  } else {
    perception.watch({});
  }
}

void Caution::keep_off(const Posture& posture, const Admissible& box, TickOutput& out) const {
  if (!whole_body_ || !inside(out)) return;
  const JointVector row = opening_row(robot_, posture, control(out, Vector3::Zero()));
  keep_rate(row, 0.0, box, out.qd);
}

void Caution::slow_into_unseen(double time, const Posture& posture, const Perception& perception,
                               const Admissible& box, TickOutput& out, Monitor& monitor) const {
  const double from = config_.degraded_after, to = config_.hold_after;
  for (std::size_t sensor = 0; sensor < perception.freshness().sensors(); ++sensor) {
    const double blind = perception.freshness().blind_for(sensor, time);
    if (!(blind > from)) continue;
    const int link = perception.link(sensor);
    const Pose T_WS = posture.T_WL[static_cast<std::size_t>(link)] * perception.T_LS(sensor);
    Jacobian6 J;
    robot_.jacobian(posture, link, T_WS.translation(), J);
    double share = to > from ? std::clamp((to - blind) / (to - from), 0.0, 1.0) : 0.0;
    if (std::isinf(to)) share = 1.0;  // it never comes to HOLD
    double wanted = 0.0;
    for (const Vector3& view_S : view_S_) {
      const JointVector row = -(J.topRows<3>().transpose() * (T_WS.linear() * view_S));
      wanted = std::max(wanted, -row.dot(out.qd));
      keep_rate(row, -share * config_.blind_speed, box, out.qd);
    }
    if (blind > to && wanted > kInto) {
      monitor.add(
          {.reason = Reason::kBlindMotion, .sensor = static_cast<int>(sensor), .age = blind});
    }
  }
}

}  // namespace proxcgal::detail
