#include "control_points.hpp"

#include <algorithm>
#include <cmath>

#include "proxcgal/error.hpp"
#include "signed_pair.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kNearerBy = 0.01;  // [m] another link must be, to be taken at once
constexpr double kLeastTime = 0.1;  // [s] else a link is kept for

ControlPair control_of(const ClosestPair& pair, const Vector3& velocity_W) {
  ControlPair control;
  control.link = pair.link;
  control.control_W = pair.surface_W;
  control.obstacle_W = pair.obstacle_W;
  control.obstacle_velocity_W = velocity_W;
  control.distance = pair.distance;
  return control;
}

void note(Monitor& monitor, Reason reason, int link) {
  monitor.add({.reason = reason, .link = link});
}

}  // namespace

ControlPoints::ControlPoints(const Robot& robot, const Skin& skin, const ControllerConfig& config)
    : method_(config.method), min_row_norm_(config.min_row_norm) {
  const auto moves = [&](int link) {
    return robot.spec().links[static_cast<std::size_t>(link)].joint >= 0;
  };
  for (const std::string& name : config.avoid_links) {
    const int link = robot.link_row(name);
    if (std::find(links_.begin(), links_.end(), link) != links_.end()) {
      throw ConfigError("controller: avoid_links names '" + name + "' twice");
    }
    links_.push_back(link);
  }
  for (int link = 0; config.avoid_links.empty() && link < robot.n_links(); ++link) {
    if (moves(link)) links_.push_back(link);
  }
  for (const Mount& mount : skin.mounts) {
    const int link = robot.link_row(mount.link);
    sensor_link_.push_back(moves(link) ? link : -1);
  }
  const bool avoids = std::any_of(config.tasks.begin(), config.tasks.end(), [](const auto& task) {
    return std::holds_alternative<Avoidance>(task);
  });
  if (avoids && links_.empty()) {
    throw ConfigError("controller: no joint moves a link of robot '" + robot.spec().name +
                      "' that carries a mesh, so avoidance could do nothing");
  }
  const bool any_sensor =
      std::any_of(sensor_link_.begin(), sensor_link_.end(), [](int link) { return link >= 0; });
  if (avoids && config.control_point == ControlPoint::kSensor && !any_sensor) {
    throw ConfigError(
        "controller: control_point is 'sensor', but the skin has no sensor on a link that a joint "
        "moves");
  }
  passed_.reserve(links_.size());
  passed_over_.assign(static_cast<std::size_t>(robot.n_links()), false);
  per_link_.resize(links_.size());
  each_.resize(links_.size());
  chosen_.reserve(std::max<std::size_t>(links_.size(), 1));
}

std::optional<ClosestPair> ControlPoints::nearest(double time, const Robot& robot,
                                                  const Posture& posture, const PointsRef& cloud_W,
                                                  double d_min, double engaged_within,
                                                  Monitor& monitor) {
  const auto controllable = [&](const ClosestPair& pair) {
    return row_norm(robot, posture, control_of(pair, Vector3::Zero())) >= min_row_norm_;
  };
  steps_ = kSearchSteps;
  // What was passed over a moment ago most likely will be again: the others are asked first.
  ClosestPair best;
  const auto first_passed = std::partition(links_.begin(), links_.end(), [&](int link) {
    return !passed_over_[static_cast<std::size_t>(link)];
  });
  auto asked_end = first_passed;
  passed_.clear();
  while (asked_end != links_.begin()) {
    const std::span<const int> asked(links_.begin(), asked_end);
    best = closest_pair(robot, posture, cloud_W, method_,
                        {.links = asked, .before = before_, .steps = &steps_});
    if (!best.found()) return std::nullopt;
    if (controllable(best)) break;
    passed_.push_back(best);
    best = {};
    const auto passed = std::find(links_.begin(), asked_end, passed_.back().link);
    --asked_end;
    std::iter_swap(passed, asked_end);
  }
  for (auto link = first_passed; link != links_.end(); ++link) {
    ClosestPair& before = per_link_[static_cast<std::size_t>(link - links_.begin())];
    const ClosestPair nearer = closest_pair(robot, posture, cloud_W, method_,
                                            {.links = std::span(&*link, 1),
                                             .before = before,
                                             .within = best.distance,
                                             .steps = &steps_});
    before = nearer;
    if (!nearer.found()) continue;
    if (controllable(nearer)) {
      best = nearer;
    } else {
      passed_.push_back(nearer);
    }
  }
  std::fill(passed_over_.begin(), passed_over_.end(), false);
  double nearest_passed = kInfinity;
  int link_passed = -1;
  for (const ClosestPair& pair : passed_) {
    passed_over_[static_cast<std::size_t>(pair.link)] = true;
    if (!(pair.distance < best.distance)) continue;
    note(monitor, Reason::kLinkSkipped, pair.link);
    if (!(pair.distance < nearest_passed)) continue;
    nearest_passed = pair.distance;
    link_passed = pair.link;
  }
  before_ = best;
  if (best.lower_bound) note(monitor, Reason::kWorkBounded, best.link);
  if (best.found()) return settled(time, robot, posture, cloud_W, d_min, best);
  if (nearest_passed < engaged_within) note(monitor, Reason::kNoControllableLink, link_passed);
  return std::nullopt;
}

ClosestPair ControlPoints::settled(double time, const Robot& robot, const Posture& posture,
                                   const PointsRef& cloud_W, double d_min,
                                   const ClosestPair& nearest) {
  if (nearest.link == link_) return nearest;
  const bool may_stay = link_ >= 0 && time - switched_ < kLeastTime && nearest.distance >= d_min &&
                        !passed_over_[static_cast<std::size_t>(link_)];
  if (may_stay) {
    ClosestPair same = closest_pair(
        robot, posture, cloud_W, method_,
        {.links = std::span(&link_, 1), .within = nearest.distance + kNearerBy, .steps = &steps_});
    if (same.found()) return same;
  }
  link_ = nearest.link;
  switched_ = time;
  return nearest;
}

ClosestPair ControlPoints::nearest_of(const Robot& robot, const Posture& posture,
                                      const PointsRef& rows_W, double within) {
  ClosestPair best;
  for (const int link : links_) {
    if (passed_over_[static_cast<std::size_t>(link)]) continue;
    const ClosestPair pair = closest_pair(robot, posture, rows_W, method_,
                                          {.links = std::span(&link, 1),
                                           .within = std::min(within, best.distance),
                                           .steps = &steps_});
    if (pair.found()) best = pair;
  }
  return best;
}

std::span<const ControlPair> ControlPoints::sensor(const Skin& skin, const Posture& posture,
                                                   const PointsRef& cloud_W,
                                                   const ObstacleVelocities& velocities) {
  chosen_.clear();
  ControlPair control;
  double nearest = kInfinity;
  for (std::size_t s = 0; s < sensor_link_.size(); ++s) {
    if (sensor_link_[s] < 0) continue;
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(sensor_link_[s])];
    const Vector3 mount_W = T_WL * skin.mounts[s].T_LS.translation();
    for (Eigen::Index i = 0; i < cloud_W.rows(); ++i) {
      const Vector3 point_W = cloud_W.row(i).transpose();
      const double squared = (point_W - mount_W).squaredNorm();
      if (!(squared < nearest)) continue;
      nearest = squared;
      control.link = sensor_link_[s];
      control.control_W = mount_W;
      control.obstacle_W = point_W;
      control.obstacle_velocity_W = velocities.of(static_cast<int>(i));
    }
  }
  control.distance = std::sqrt(nearest);
  if (control.link >= 0) chosen_.push_back(control);
  return chosen_;
}

void ControlPoints::search_each(const Robot& robot, const Posture& posture,
                                const PointsRef& cloud_W, std::span<const double> within,
                                Monitor& monitor) {
  for (std::size_t row = 0; row < links_.size(); ++row) {
    if (!(within[static_cast<std::size_t>(links_[row])] > 0.0)) {
      each_[row] = {};
      continue;
    }
    each_[row] = closest_pair(robot, posture, cloud_W, method_,
                              {.links = std::span(&links_[row], 1),
                               .before = each_[row],
                               .within = within[static_cast<std::size_t>(links_[row])],
                               .steps = &steps_});
    if (each_[row].lower_bound) note(monitor, Reason::kWorkBounded, each_[row].link);
  }
}

std::span<const ControlPair> ControlPoints::links(const Robot& robot, const Posture& posture,
                                                  int count, double within,
                                                  const ObstacleVelocities& velocities) {
  chosen_.clear();
  for (const ClosestPair& pair : each_) {
    if (!pair.found() || !(pair.distance < within)) continue;
    const ControlPair control = signed_pair(robot, posture, pair, velocities);
    if (row_norm(robot, posture, control) >= min_row_norm_) chosen_.push_back(control);
  }
  std::sort(chosen_.begin(), chosen_.end(),
            [](const auto& x, const auto& y) { return x.distance < y.distance; });
  if (chosen_.size() > static_cast<std::size_t>(count))
    chosen_.erase(chosen_.begin() + count, chosen_.end());
  return chosen_;
}

std::span<const ControlPair> ControlPoints::one(const ControlPair& control) {
  chosen_.clear();
  chosen_.push_back(control);
  return chosen_;
}

}  // namespace proxcgal::detail
