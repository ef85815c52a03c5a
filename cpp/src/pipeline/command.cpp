#include "proxcgal/pipeline/command.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/velocity_box.hpp"

namespace proxcgal {
namespace {

/// Rates nearer than this are equal [m/s] or [rad/s]: a task that has all but faded out must not
/// rule the ones below it.
constexpr double kTie = 1e-6;

/// The fastest a joint may go in this tick and still brake to rest within `room`.
///
/// With v = (k + f) a dt, 0 <= f < 1, the ticks until rest cover
/// a dt^2 ((k + 1) f + k (k + 1) / 2); this is its inverse.
double stoppable(double room, double a, double dt) {
  if (!(room > 0.0)) return 0.0;
  if (std::isinf(room)) return kInfinity;
  if (std::isinf(a)) return room / dt;
  const double ticks = room / (a * dt * dt);
  if (!(ticks < 1e12)) return std::sqrt(2.0 * a * room);  // dt too small to tell from 0
  const double k = std::floor(0.5 * (std::sqrt(1.0 + 8.0 * ticks) - 1.0));
  return a * dt * (k + (ticks - 0.5 * k * (k + 1.0)) / (k + 1.0));
}

JointVector inside(const JointVector& qd, const Admissible& box) {
  return qd.cwiseMax(box.low).cwiseMin(box.high);
}

/// The farthest point of the way 0, rho_1, rho_2, ... that position and velocity limits allow.
struct Target {
  JointVector qd;
  std::size_t level = 0;  ///< the lowest level it holds a part of
};

Target steady_target(std::span<const JointVector> levels, const Admissible& box) {
  for (std::size_t k = levels.size(); k-- > 0;) {
    const JointVector from = k > 0 ? levels[k - 1] : JointVector::Zero(levels[k].size());
    const JointVector step = levels[k] - from;
    const double s = box::last_inside(from, step, box.steady_low, box.steady_high);
    if (s >= 0.0) return {box::along(from, s, step, box.steady_low, box.steady_high), k};
  }
  return {JointVector::Zero(levels[0].size()), 0};
}

/// From `anchor` towards `levels[first]`, then the levels below it up to the target's, each with
/// at most the same share.
JointVector towards(std::span<const JointVector> levels, std::size_t first, const Target& target,
                    const JointVector& anchor, const Admissible& box) {
  const auto node = [&](std::size_t k) { return k == target.level ? target.qd : levels[k]; };
  const JointVector step = node(first) - anchor;
  const double s = box::share(anchor, step, box.low, box.high);
  JointVector qd = box::along(anchor, s, step, box.low, box.high);
  for (std::size_t k = first + 1; k <= target.level; ++k) {
    const JointVector more = s * (node(k) - node(k - 1));
    qd = box::along(qd, box::share(qd, more, box.low, box.high), more, box.low, box.high);
  }
  return qd;
}

/// Is `qd` nearer than `best` to what `target` does for the tasks, the most important one first?
///
/// The target's own rates are the measure, not the reference rates: where a task is half active
/// the solver has already weighed it against the lower ones.
bool nearer(std::span<const Task> tasks, const JointVector& target, const JointVector& qd,
            const JointVector& best) {
  for (const Task& task : tasks) {
    const auto missing = [&](const JointVector& v) {
      return task.activation.cwiseProduct(task.jacobian * (target - v)).norm();
    };
    const double gain = missing(best) - missing(qd);
    if (std::abs(gain) > kTie) return gain > 0.0;
  }
  return false;
}

}  // namespace

Admissible admissible(const Limits& limits, const JointVector& q, const JointVector& qd, double dt,
                      double speed_scale) {
  const auto n = q.size();
  Admissible box;
  box.low.resize(n);
  box.high.resize(n);
  box.steady_low.resize(n);
  box.steady_high.resize(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double fastest = speed_scale > 0.0 ? speed_scale * limits.qd_max[j] : 0.0;
    const double a = limits.qdd_max[j];
    box.steady_low[j] = -std::min(fastest, stoppable(q[j] - limits.q_min[j], a, dt));
    box.steady_high[j] = std::min(fastest, stoppable(limits.q_max[j] - q[j], a, dt));
    const double slowest = qd[j] - a * dt;
    const double quickest = qd[j] + a * dt;
    box.low[j] = std::clamp(box.steady_low[j], slowest, quickest);
    box.high[j] = std::clamp(box.steady_high[j], slowest, quickest);
  }
  return box;
}

void command(std::span<const JointVector> levels, std::span<const Task> tasks,
             const JointVector& qd_last, const Admissible& box, JointVector& out) {
  if (box::contains(box.low, box.high, levels.back())) {
    out = levels.back();
    return;
  }
  const JointVector anchor = inside(qd_last, box);
  const Target target = steady_target(levels, box);
  out = towards(levels, target.level, target, anchor, box);
  for (std::size_t first = target.level; first-- > 0;) {
    const JointVector other = towards(levels, first, target, anchor, box);
    if (nearer(tasks, target.qd, other, out)) out = other;
  }
}

void decelerate(const JointVector& qd_last, const Admissible& box, JointVector& out) {
  const JointVector anchor = inside(qd_last, box);
  const JointVector step = -anchor;
  out = box::along(anchor, box::share(anchor, step, box.low, box.high), step, box.low, box.high);
}

double keep_rate(const JointVector& row, double least, const Admissible& box, JointVector& qd) {
  // The nearest such velocity is qd + t row, cut off at the bounds: raise t from bound to bound.
  JointVector push = row;
  double rate = row.dot(qd);
  while (rate < least) {
    const double slope = row.dot(push);
    if (!(slope > 0.0)) break;  // every joint that could help is at its bound
    double t = (least - rate) / slope;
    Eigen::Index stopped = -1;
    for (Eigen::Index j = 0; j < row.size(); ++j) {
      if (push[j] == 0.0) continue;
      const double room = push[j] > 0.0 ? box.high[j] - qd[j] : box.low[j] - qd[j];
      if (room / push[j] > t) continue;
      t = room / push[j];
      stopped = j;
    }
    qd = inside(qd + t * push, box);
    rate = row.dot(qd);
    if (stopped < 0) break;
    push[stopped] = 0.0;
  }
  return rate;
}

void catch_up(std::span<const JointVector> levels, const Task& task, const Admissible& box,
              JointVector& qd) {
  if (!(task.activation.array() > 0.0).any()) return;
  const JointVector target = steady_target(levels, box).qd;
  // What each row is to have, before one of them takes from another.
  const RowVector now = task.jacobian * qd;
  const RowVector least =
      now + task.activation.cwiseProduct((task.jacobian * target - now).cwiseMax(0.0));
  for (Eigen::Index i = task.activation.size(); i-- > 0;) {
    if (task.activation[i] > 0.0) keep_rate(task.jacobian.row(i).transpose(), least[i], box, qd);
  }
}

}  // namespace proxcgal
