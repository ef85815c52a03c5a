#include "approach_limits.hpp"

#include <algorithm>
#include <cmath>

namespace proxcgal::detail {
namespace {

constexpr double kInto = 0.02;  // [m/s] slower motion into the unseen is not reported

std::array<Vector3, 5> view_directions(const SensorModel& model) {
  const double edge = std::tan(0.5 * model.field_of_view);
  std::array<Vector3, 5> directions{Vector3(0, 0, 1), Vector3(edge, edge, 1),
                                    Vector3(-edge, edge, 1), Vector3(edge, -edge, 1),
                                    Vector3(-edge, -edge, 1)};
  for (Vector3& direction : directions) direction.normalize();
  return directions;
}

}  // namespace

ApproachLimits::ApproachLimits(const Robot& robot, const Skin& skin, const ControllerConfig& config)
    : robot_(robot),
      config_(config.monitor),
      whole_body_(config.control_point == ControlPoint::kWholeBody),
      view_S_(view_directions(skin.model)) {}

void ApproachLimits::keep_off(const Posture& posture, const TrustedDistance& trusted,
                              const Admissible& box, TickOutput& out) const {
  if (!whole_body_ || !trusted.inside(out)) return;
  const JointVector row = opening_row(robot_, posture, trusted.control(out, Vector3::Zero()));
  keep_rate(row, 0.0, box, out.qd);
}

void ApproachLimits::slow_into_unseen(double time, const Posture& posture,
                                      const Perception& perception, const Admissible& box,
                                      TickOutput& out, Monitor& monitor) const {
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
