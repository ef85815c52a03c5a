#include "distance_rows.hpp"

#include <algorithm>
#include <cmath>

namespace proxcgal::detail {
namespace {

constexpr double kBlindMotion = 0.02;   // [m/s] slower motion into a silent view is not reported
constexpr double kSameRow = 1e-9;       // [m] rows that differ by less are one
constexpr double kStiffest = 10.0;      // [1/s]
constexpr double kFarthestReach = 1.5;  // [m] of a search round a link

std::array<Vector3, 5> view_directions(const SensorModel& model) {
  const double edge = std::tan(0.5 * model.field_of_view);
  std::array<Vector3, 5> directions{Vector3(0, 0, 1), Vector3(edge, edge, 1),
                                    Vector3(-edge, edge, 1), Vector3(edge, -edge, 1),
                                    Vector3(-edge, -edge, 1)};
  for (Vector3& direction : directions) direction.normalize();
  return directions;
}

}  // namespace

DistanceRows::DistanceRows(const Robot& robot, const Skin& skin, const ControllerConfig& config)
    : robot_(robot),
      config_(config),
      whole_body_(config.control_point == ControlPoint::kWholeBody),
      farthest_sigma_(skin.model.sigma(std::min(skin.model.workspace, skin.model.max_range))),
      view_S_(view_directions(skin.model)),
      within_(static_cast<std::size_t>(robot.n_links()), 0.0) {
  const auto links = static_cast<std::size_t>(robot.n_links());
  silent_.reserve(skin.mounts.size() * view_S_.size());
  caps_.reserve(4 * links + kMaxRows + silent_.capacity());
  retreats_.reserve(2 * links + kMaxRows + 1);
}

void DistanceRows::begin() {
  std::fill(within_.begin(), within_.end(), 0.0);
  caps_.clear();
  retreats_.clear();
  silent_.clear();
}

const Avoidance* DistanceRows::avoidance() const {
  for (const TaskSpec& task : config_.tasks)
    if (const auto* spec = std::get_if<Avoidance>(&task)) return spec;
  return nullptr;
}

void DistanceRows::reach(const LimitState& state, const JointVector& qd_last, double elapsed,
                         const Posture& posture, double fastest_obstacle) {
  const Avoidance* spec = avoidance();
  const LimitConfig& limit = config_.limit;
  const JointVector change = elapsed * robot_.qdd_max();
  Jacobian6 J;
  for (int link = 0; link < robot_.n_links(); ++link) {
    const Bounds& bounds = robot_.tree(link).bounds();
    const Vector3 center_W = posture.T_WL[static_cast<std::size_t>(link)] * bounds.center;
    robot_.jacobian(posture, link, center_W, J);
    // No point of the link is faster than this, whatever the tick commands.
    double fastest =
        (J.topRows<3>() * qd_last).norm() + bounds.radius * (J.bottomRows<3>() * qd_last).norm();
    for (Eigen::Index j = 0; j < change.size(); ++j)
      fastest +=
          change[j] * (J.col(j).head<3>().norm() + bounds.radius * J.col(j).tail<3>().norm());
    ApproachCap cap{.stop = limit.d_stop, .near = limit.near_distance};
    const double overrun = 2.0 * (limit.dead_time + limit.lag) * fastest;
    double far = overrun + robot_.mesh_error(link) + limit.sigmas * farthest_sigma_ +
                 approach_distance(limit, cap, fastest, state.reaction, state.braking_time);
    if (spec != nullptr)
      far = std::max(far, spec->d_min + (fastest + fastest_obstacle) / spec->gain);
    within_[static_cast<std::size_t>(link)] = std::min(far, kFarthestReach);
  }
}

void DistanceRows::reach_at_least(double within) {
  for (double& each : within_) each = std::max(each, within);
}

double DistanceRows::shortened(const DistanceScene& scene, const ControlPair& control,
                               int point) const {
  if (scene.perception == nullptr) return 0.0;
  const Perception& perception = *scene.perception;
  const PointOrigin& origin = perception.origins()[static_cast<std::size_t>(point)];
  const double less =
      robot_.mesh_error(control.link) + config_.limit.sigmas * perception.sigma(point);
  if (origin.sensor < 0 || point >= perception.seen_points()) return less;
  const auto sensor = static_cast<std::size_t>(origin.sensor);
  const double late = perception.freshness().age(sensor, scene.time) - config_.monitor.fresh_within;
  return less + config_.monitor.approach_speed * std::max(0.0, late);
}

void DistanceRows::add_pair(const DistanceScene& scene, const ControlPair& control, int point) {
  const JointVector row = opening_row(robot_, scene.posture, control);
  const double less = shortened(scene, control, point);
  caps_.push_back({.row = row,
                   .distance = control.distance - less,
                   .stop = config_.limit.d_stop,
                   .near = config_.limit.near_distance,
                   .kind = LimitKind::kApproach,
                   .link = control.link});
  const Avoidance* spec = avoidance();
  if (!whole_body_ || spec == nullptr || row.norm() < config_.min_row_norm) return;
  add_retreat(*spec, control, row);
}

void DistanceRows::add_retreat(const Avoidance& spec, const ControlPair& control,
                               const JointVector& row) {
  retreats_.push_back({.row = row,
                       .distance = control.distance,
                       .d_min = spec.d_min,
                       .gain = spec.gain,
                       .obstacle_rate = normal_W(control).dot(control.obstacle_velocity_W),
                       .kind = LimitKind::kRetreat,
                       .link = control.link});
}

void DistanceRows::add_links(const DistanceScene& scene, ControlPoints& control_points) {
  const Avoidance* spec = avoidance();
  for (const ClosestPair& pair : control_points.each()) {
    if (!pair.found()) continue;
    const ControlPair control = signed_pair(robot_, scene.posture, pair, scene.velocities);
    add_pair(scene, control, pair.point);
    if (spec == nullptr || !(control.distance < spec->d_min)) continue;
    const ClosestPair behind = other_side(robot_, scene.posture, scene.cloud_W, control,
                                          within_[static_cast<std::size_t>(pair.link)]);
    if (behind.found())
      add_pair(scene, signed_pair(robot_, scene.posture, behind, scene.velocities), behind.point);
  }
}

void DistanceRows::keep_nearest(const Posture& posture, const ControlPair& pair, double nearest,
                                const LimitState& state) {
  const Avoidance* spec = avoidance();
  if (!whole_body_ || spec == nullptr) return;
  // Inside d_min the nearest pair comes no nearer, whatever the other rows ask for, and those that
  // are hardly farther off hardly nearer: between two equals nothing jumps.
  const double beyond =
      std::max(0.0, nearest - spec->d_min) / (state.reaction + 0.5 * state.braking_time);
  const double stiffness =
      std::min(kStiffest, std::exp(-1.0) / config_.limit.loop_delay(config_.period));
  // An old scan's pair may count as the nearest although its link has one that is nearer.
  const JointVector row = opening_row(robot_, posture, pair);
  const bool known = std::any_of(caps_.begin(), caps_.end(), [&](const ApproachCap& cap) {
    return cap.link == pair.link && (cap.row - row).norm() < kSameRow;
  });
  if (!known) {
    caps_.push_back({.row = row,
                     .distance = nearest,
                     .stop = config_.limit.d_stop,
                     .near = config_.limit.near_distance,
                     .kind = LimitKind::kApproach,
                     .link = pair.link});
  }
  for (ApproachCap& cap : caps_) {
    if (cap.kind != LimitKind::kApproach) continue;
    const double farther = std::max(0.0, cap.distance - nearest);
    cap.speed = std::min(cap.speed, stiffness * farther + beyond);
  }
}

void DistanceRows::add_sensor_point(const Posture& posture, const ControlPair& control) {
  const Avoidance* spec = avoidance();
  const JointVector row = opening_row(robot_, posture, control);
  if (spec == nullptr || row.norm() < config_.min_row_norm) return;
  add_retreat(*spec, control, row);
}

void DistanceRows::add_own(const Posture& posture, const SelfCollision& spec,
                           std::span<const LinkPair> pairs) {
  for (const LinkPair& pair : pairs) {
    const JointVector row = parting_row(robot_, posture, pair);
    caps_.push_back({.row = row,
                     .distance = pair.distance,
                     .stop = std::min(config_.limit.own_stop, spec.d_min),
                     .near = 0.0,
                     .kind = LimitKind::kOwnApproach,
                     .link = pair.a});
    retreats_.push_back({.row = row,
                         .distance = pair.distance,
                         .d_min = spec.d_min,
                         .gain = spec.gain,
                         .kind = LimitKind::kOwnRetreat,
                         .link = pair.a});
  }
}

void DistanceRows::add_floor(const Posture& posture) {
  const double floor = config_.limit.floor;
  if (std::isinf(floor)) return;
  Jacobian6 J;
  for (int link = 0; link < robot_.n_links(); ++link) {
    const auto at = static_cast<std::size_t>(link);
    if (robot_.spec().links[at].joint < 0) continue;
    const MeshTree& tree = robot_.tree(link);
    const Pose& T_WL = posture.T_WL[at];
    const double reach = tree.bounds().radius + std::max(within_[at], config_.limit.d_stop);
    if ((T_WL * tree.bounds().center).z() - reach > floor) continue;
    const Vector3 up_L = T_WL.linear().row(2).transpose();
    Eigen::Index lowest = 0;
    const double height = (tree.vertices_L() * up_L).minCoeff(&lowest) + T_WL.translation().z();
    robot_.jacobian(posture, link, T_WL * Vector3(tree.vertices_L().row(lowest).transpose()), J);
    caps_.push_back({.row = J.row(2).transpose(),
                     .distance = height - floor,
                     .stop = config_.limit.d_stop,
                     .near = config_.limit.near_distance,
                     .kind = LimitKind::kFloor,
                     .link = link});
  }
}

void DistanceRows::add_silent_views(double time, const Posture& posture,
                                    const Perception& perception) {
  const double from = config_.monitor.degraded_after, to = config_.monitor.hold_after;
  for (std::size_t sensor = 0; sensor < perception.freshness().sensors(); ++sensor) {
    const double silent_for = perception.freshness().blind_for(sensor, time);
    if (!(silent_for > from)) continue;
    const int link = perception.link(sensor);
    const Pose T_WS = posture.T_WL[static_cast<std::size_t>(link)] * perception.T_LS(sensor);
    Jacobian6 J;
    robot_.jacobian(posture, link, T_WS.translation(), J);
    double share = to > from ? std::clamp((to - silent_for) / (to - from), 0.0, 1.0) : 0.0;
    if (std::isinf(to)) share = 1.0;  // it never comes to HOLD
    for (const Vector3& view_S : view_S_) {
      silent_.push_back({caps_.size(), static_cast<int>(sensor), silent_for});
      caps_.push_back({.row = -(J.topRows<3>().transpose() * (T_WS.linear() * view_S)),
                       .speed = share * config_.monitor.blind_speed,
                       .kind = LimitKind::kUnknown,
                       .link = link});
    }
  }
}

void DistanceRows::report_blind_motion(const JointVector& nominal, Monitor& monitor) const {
  int reported = -1;
  for (const SilentView& view : silent_) {
    if (!(view.silent_for > config_.monitor.hold_after) || view.sensor == reported) continue;
    if (!(-caps_[view.cap].row.dot(nominal) > kBlindMotion)) continue;
    reported = view.sensor;
    monitor.add({.reason = Reason::kBlindMotion, .sensor = view.sensor, .age = view.silent_for});
  }
}

std::span<const RetreatRow> DistanceRows::retreats() {
  std::sort(retreats_.begin(), retreats_.end(),
            [](const RetreatRow& x, const RetreatRow& y) { return x.distance < y.distance; });
  return retreats_;
}

}  // namespace proxcgal::detail
