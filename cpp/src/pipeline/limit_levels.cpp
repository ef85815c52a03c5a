#include "limit_levels.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace proxcgal::detail {
namespace {

/// [m/s per rad/s] Square root of the weight of |qd - near|^2 in (2a) and (2b): of many optima it
/// picks the one next to the nominal, and a row of that norm fades out instead of asking for any
/// joint speed. A row of norm 0.05 misses its optimum by 4e-6 of its rate.
constexpr double kMotion = 1e-4;
/// The same where the arm stands because it is pinched: what is left to gain by motion along which
/// the rows hardly change is not worth it.
constexpr double kCalmMotion = 1.0;
/// [m/s] The same of what (2a) found: rows that all hold with equality leave no calm motion.
constexpr double kCalmLeeway = 0.01;
/// [m/s] by which what a level above found is relaxed: its rounding.
constexpr double kRelax = 1e-11;

}  // namespace

Levels::Levels(int n)
    : n_(n),
      joints_(LeastDistance::make(n, 2 * n + kMaxCaps + kMaxRetreats)),
      slacks_(LeastDistance::make(n + kMaxRetreats, 2 * n + kMaxCaps + 2 * kMaxRetreats)),
      L_(JointMatrix::Identity(n, n)),
      L_inverse_(L_),
      scratch_(JointVector::Zero(n)) {}

void Levels::calm(double stand) {
  motion_ = std::max(kMotion, kCalmMotion * stand);
  leeway_ = kCalmLeeway * stand;
}

/// Rows (0) and (1) in z = scale (qd - centre).
void Levels::begin(LeastDistance& solver, int variables, Programme& programme,
                   const JointVector& centre, double scale) {
  solver.begin(variables);
  for (int j = 0; j < n_; ++j) {
    const auto k = static_cast<std::size_t>(j);
    scratch_.setZero(n_);
    scratch_[j] = 1.0;
    at_low_[k] = solver.add(scratch_, scale * (programme.state->interval.low[j] - centre[j]));
    scratch_[j] = -1.0;
    at_high_[k] = solver.add(scratch_, scale * (centre[j] - programme.state->interval.high[j]));
  }
  for (int i = 0; i < programme.n_caps; ++i) {
    BoundRow& cap = programme.caps[static_cast<std::size_t>(i)];
    if (!cap.binds) continue;
    scratch_ = *cap.row / scale;
    cap.at = solver.add(scratch_, cap.least - cap.row->dot(centre));
  }
}

bool Levels::finish(LeastDistance& solver, const Programme& programme, const JointVector& centre,
                    double scale, JointVector& qd) {
  const bool found = solver.solve();
  iterations += solver.iterations();
  ++solved;
  if (!found) return false;
  for (int j = 0; j < n_; ++j) scratch_[j] = centre[j] + solver.y(j) / scale;
  qd = scratch_.cwiseMax(programme.state->interval.low).cwiseMin(programme.state->interval.high);
  return true;
}

bool Levels::least_violation(Programme& programme, const JointVector& near, JointVector& qd) {
  // (2a)  min t^2 + (motion |qd - near|)^2  s.t.  row qd + t >= rate - allowance, (0), (1)
  const double scale = motion_;
  begin(*slacks_, n_ + 1, programme, near, scale);
  for (int i = 0; i < programme.n_retreats; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const BoundRow& retreat = programme.retreats[k];
    if (!retreat.binds) continue;
    scratch_ = *retreat.row / scale;
    slacks_->add(scratch_, n_, 1.0,
                 retreat.least - programme.allowance[k] - retreat.row->dot(near));
  }
  return finish(*slacks_, programme, near, scale, qd);
}

bool Levels::least_squares(Programme& programme, const JointVector& near, double most,
                           JointVector& qd) {
  // (2b)  min sum w s^2 + (motion |qd - near|)^2  s.t.  row qd + s >= rate,
  //       row qd >= rate - allowance - t, (0), (1)
  const double scale = motion_;
  begin(*slacks_, n_ + programme.n_retreats, programme, near, scale);
  for (int i = 0; i < programme.n_retreats; ++i) {
    const auto k = static_cast<std::size_t>(i);
    BoundRow& retreat = programme.retreats[k];
    retreat.at = at_most_[k] = -1;
    if (!retreat.binds) continue;
    scratch_ = *retreat.row / scale;
    const double rate = retreat.least - retreat.row->dot(near);
    retreat.at = slacks_->add(scratch_, n_ + i, 1.0 / std::sqrt(programme.weight[k]), rate);
    // The slack is bounded, not the row once more: two rows that are all but parallel look like a
    // contradiction.
    scratch_.setZero(n_);
    at_most_[k] = slacks_->add(scratch_, n_ + i, -1.0 / std::sqrt(programme.weight[k]),
                               -(programme.allowance[k] + most + leeway_ + kRelax));
  }
  return finish(*slacks_, programme, near, scale, qd);
}

double Levels::contradiction(const Programme& programme, const JointVector& qd) const {
  // Optimality of (2b): sum of multipliers x rows of (2), (1) and (0) is about 0. What the joints'
  // bounds of (0) balance is not blocked by what is around.
  JointVector pull = JointVector::Zero(n_);
  double demand = 0.0;
  for (int i = 0; i < programme.n_retreats; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const BoundRow& retreat = programme.retreats[k];
    if (!retreat.binds) continue;
    const double missing = std::max(0.0, retreat.least - retreat.row->dot(qd));
    const double force = programme.weight[k] * missing + slacks_->multiplier(at_most_[k]);
    pull += force * *retreat.row;
    demand += force * retreat.row->norm();
  }
  if (!(demand > 0.0)) return 0.0;
  for (int i = 0; i < programme.n_caps; ++i) {
    const BoundRow& cap = programme.caps[static_cast<std::size_t>(i)];
    if (cap.binds) pull += slacks_->multiplier(cap.at) * *cap.row;
  }
  return std::clamp(1.0 - pull.norm() / demand, 0.0, 1.0);
}

bool Levels::weigh(std::span<const Task> tasks, const LimitConfig& config) {
  L_ = config.least_weight * JointMatrix::Identity(n_, n_);
  double weight = 1.0;
  for (const Task& task : tasks) {
    if (task.jacobian.cols() != n_) continue;
    const double w = std::max(weight, config.least_weight);
    for (Eigen::Index i = 0; i < task.activation.size(); ++i) {
      if (!(task.activation[i] > 0.0)) continue;
      scratch_ = task.jacobian.row(i).transpose();
      L_.noalias() += (w * task.activation[i]) * scratch_ * scratch_.transpose();
    }
    weight *= config.level_ratio;
  }
  Eigen::LLT<JointMatrix> factor(L_);
  L_inverse_.setIdentity(n_, n_);
  const bool good = factor.info() == Eigen::Success && L_.allFinite();
  if (good) factor.matrixL().solveInPlace(L_inverse_);
  if (good && L_inverse_.allFinite()) return true;
  L_inverse_.setIdentity(n_, n_);
  return false;
}

bool Levels::nearest(Programme& programme, const JointVector& target,
                     const std::array<double, kMaxRetreats>& least, JointVector& qd) {
  // (3)  min |y|^2, y = L' (qd - target), W = L L';  a row r qd >= b is (L^-1 r)' y >= b - r target
  joints_->begin(n_);
  for (int j = 0; j < n_; ++j) {
    const auto k = static_cast<std::size_t>(j);
    scratch_ = L_inverse_.col(j);
    at_low_[k] = joints_->add(scratch_, programme.state->interval.low[j] - target[j]);
    scratch_ = -scratch_;
    at_high_[k] = joints_->add(scratch_, target[j] - programme.state->interval.high[j]);
  }
  const auto add = [&](BoundRow& bound, double rate) {
    bound.at = -1;
    if (!bound.binds) return;
    scratch_.noalias() = L_inverse_.triangularView<Eigen::Lower>() * *bound.row;
    bound.at = joints_->add(scratch_, rate - bound.row->dot(target));
  };
  for (int i = 0; i < programme.n_caps; ++i) {
    BoundRow& cap = programme.caps[static_cast<std::size_t>(i)];
    add(cap, cap.least);
  }
  for (int i = 0; i < programme.n_retreats; ++i) {
    const auto k = static_cast<std::size_t>(i);
    add(programme.retreats[k], least[k]);
  }
  const bool found = joints_->solve();
  iterations += joints_->iterations();
  ++solved;
  if (!found) return false;
  JointVector y(n_);
  for (int j = 0; j < n_; ++j) y[j] = joints_->y(j);
  scratch_.noalias() = L_inverse_.transpose() * y;
  scratch_ += target;
  qd = scratch_.cwiseMax(programme.state->interval.low).cwiseMin(programme.state->interval.high);
  return true;
}

}  // namespace proxcgal::detail
