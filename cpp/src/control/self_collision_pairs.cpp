#include "self_collision_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace proxcgal::detail {
namespace {

constexpr std::int64_t kSteps = 120;  // pairs of subtrees in one tick, all searches together
constexpr double kStale = 1e-3;       // [m] links that moved less since are not searched again
constexpr int kPostures = 200;        // in which links that are always near one another are near
constexpr double kAlwaysNear = 0.05;  // [m]
constexpr double kAhead = 0.05;       // [m] searched beyond the task's reach, so as to rest longer

/// How many joints move one of two links and not the other; neighbours have one.
int joints_between(const Robot& robot, int a, int b) {
  int count = 0;
  for (int joint = 0; joint < robot.n_q(); ++joint) {
    if (robot.moves(joint, a) != robot.moves(joint, b)) ++count;
  }
  return count;
}

/// Are two links so near one another in every posture that their distance tells nothing?
bool always_near(const Robot& robot, int a, int b) {
  std::mt19937_64 engine(1);
  Posture posture = robot.make_posture();
  JointVector q(robot.n_q());
  for (int trial = 0; trial < kPostures; ++trial) {
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const double low = std::max(robot.q_min()[j], -std::numbers::pi);
      const double high = std::min(robot.q_max()[j], std::numbers::pi);
      const double share = static_cast<double>(engine() >> 11U) * 0x1p-53;
      q[j] = low + share * std::max(high - low, 0.0);
    }
    robot.update(q, posture);
    const Pose& T_WA = posture.T_WL[static_cast<std::size_t>(a)];
    const Pose& T_WB = posture.T_WL[static_cast<std::size_t>(b)];
    if (std::isinf(robot.tree(a).distance(robot.tree(b), T_WA.inverse() * T_WB, kAlwaysNear)))
      return false;
  }
  return true;
}

/// No point within the bounds moved farther between two poses [m].
double moved(const Pose& before, const Pose& after, const Bounds& bounds) {
  const double shift = (after * bounds.center - before * bounds.center).norm();
  // A difference of rotations has two equal singular values and a zero.
  const double turn = (after.linear() - before.linear()).norm() / std::numbers::sqrt2;
  return shift + turn * bounds.radius;
}

}  // namespace

SelfCollisionPairs::SelfCollisionPairs(const Robot& robot, const ControllerConfig& config)
    : min_row_norm_(config.min_row_norm) {
  const auto watch = [&](int a, int b) {
    watched_.push_back({.a = a, .b = b, .T_AB = Pose::Identity()});
  };
  bool asked = false;
  for (const TaskSpec& task : config.tasks) {
    const auto* spec = std::get_if<SelfCollision>(&task);
    if (spec == nullptr) continue;
    asked = true;
    for (const auto& [a, b] : spec->pairs) watch(robot.link_row(a), robot.link_row(b));
    for (int a = 0; spec->pairs.empty() && a < robot.n_links(); ++a) {
      for (int b = a + 1; b < robot.n_links(); ++b) {
        if (joints_between(robot, a, b) > 1) watch(a, b);
      }
    }
  }
  for (int a = 0; !asked && config.limit.distances && a < robot.n_links(); ++a) {
    for (int b = a + 1; b < robot.n_links(); ++b) {
      if (joints_between(robot, a, b) > 1 && !always_near(robot, a, b)) watch(a, b);
    }
  }
  near_.reserve(watched_.size());
}

std::span<const LinkPair> SelfCollisionPairs::nearest(const SelfCollision& spec, const Robot& robot,
                                                      const Posture& posture, Monitor& monitor) {
  near_.clear();
  search_.steps = kSteps;
  const double reach = spec.d_min + spec.buffer;
  const std::size_t first = next_;
  for (std::size_t i = 0; i < watched_.size(); ++i) {
    const std::size_t row = (first + i) % watched_.size();
    Watched& pair = watched_[row];
    const Pose& T_WA = posture.T_WL[static_cast<std::size_t>(pair.a)];
    const Pose& T_WB = posture.T_WL[static_cast<std::size_t>(pair.b)];
    const Bounds& round_a = robot.tree(pair.a).bounds();
    const Bounds& round_b = robot.tree(pair.b).bounds();
    const Vector3 apart_W = T_WA * round_a.center - T_WB * round_b.center;
    if (!(apart_W.norm() - round_a.radius - round_b.radius < reach)) continue;
    const Pose T_AB = T_WA.inverse() * T_WB;
    // A wider reach than it was searched for, as after `retune`: nothing is known out there.
    if (!pair.found && pair.within < reach) pair.searched = false;
    double since = pair.searched ? moved(pair.T_AB, T_AB, round_b) : kInfinity;
    if (pair.searched && pair.at_least - since >= reach) continue;
    if (since > kStale) {
      if (search_.steps > 0 || !pair.searched) {
        search(pair, robot, T_AB, reach + kAhead);
        since = 0.0;
      } else if (next_ == first) {
        next_ = row;  // it is the first whose turn did not come
      }
    }
    if (!pair.searched || pair.at_least - since >= reach) continue;
    LinkPair link{.a = pair.a, .b = pair.b, .fallback_normal_W = apart_W.normalized()};
    link.on_a_W = T_WA * pair.on_a_A;
    link.on_b_W = T_WB * pair.on_b_B;
    link.distance = pair.found ? (link.on_a_W - link.on_b_W).norm() : kInfinity;
    if (pair.at_least - since < spec.d_min && link.distance > reach) {
      monitor.add({.reason = Reason::kWorkBounded, .link = pair.a});
    }
    if (!(link.distance < reach)) continue;
    if (parting_row(robot, posture, link).norm() < min_row_norm_) continue;
    near_.push_back(link);
  }
  std::sort(near_.begin(), near_.end(),
            [](const LinkPair& x, const LinkPair& y) { return x.distance < y.distance; });
  return {near_.data(), std::min(near_.size(), static_cast<std::size_t>(spec.nearest))};
}

void SelfCollisionPairs::search(Watched& pair, const Robot& robot, const Pose& T_AB,
                                double within) {
  // The points of last time are still some of the surfaces': nothing farther is of interest.
  const double ridden = pair.found ? (pair.on_a_A - T_AB * pair.on_b_B).norm() : kInfinity;
  pair.found = ridden < within;
  const double bound = std::min(within, ridden);
  const std::int64_t left = search_.steps;
  if (!pair.searched) search_.steps = kSearchSteps;  // once, to its end: it has no points yet
  Vector3 on_a_A, on_b_B;
  const double distance =
      robot.tree(pair.a).distance(robot.tree(pair.b), T_AB, bound, &on_a_A, &on_b_B, &search_);
  if (!pair.searched) search_.steps = left;
  const double points = (on_a_A - T_AB * on_b_B).norm();
  if (distance < bound && points < bound) {
    pair.on_a_A = on_a_A;
    pair.on_b_B = on_b_B;
    pair.found = true;
  }
  pair.at_least = std::min(distance, bound);
  pair.T_AB = T_AB;
  pair.within = within;
  pair.searched = true;
}

}  // namespace proxcgal::detail
