#include "proxcgal/pipeline/solve.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <numbers>

#include "geometry/velocity_box.hpp"

namespace proxcgal {
namespace {

/// What (4.7) puts in place of 1 / s for the eigenvalue s >= 0 of M; p(s) is its damping.
double inverted(double s, const SolverConfig& config) {
  const double x = s / config.damping_threshold;
  const double p = x <= 1.0 ? config.damping * (0.5 * std::cos(std::numbers::pi * x) + 0.5) : 0.0;
  if (config.form == Damping::kCode) return s > 0.0 ? 1.0 / (s + p / s) : 0.0;
  return s + p > 0.0 ? 1.0 / (s + p) : 0.0;
}

/// (M + V'PV)^# of (4.7): V diag(inverted(s)) V' of a symmetric M with eigenvalues s >= 0.
class Inverse {
 public:
  void factor(const JointMatrix& M, const SolverConfig& config) {
    // No eigenvalue below s_th, so P = 0 and this is M^-1 in either form: no need to know them.
    cholesky_.compute(M - config.damping_threshold * JointMatrix::Identity(M.rows(), M.cols()));
    undamped_ = cholesky_.info() == Eigen::Success;
    if (undamped_) {
      cholesky_.compute(M);
      return;
    }
    eigen_.compute(M);
    // What rounding leaves of an eigenvalue that is zero, of either sign.
    const double rounding = static_cast<double>(M.rows()) * std::numeric_limits<double>::epsilon() *
                            eigen_.eigenvalues().cwiseAbs().maxCoeff();
    inverted_ = eigen_.eigenvalues().unaryExpr(
        [&](double s) { return inverted(s > rounding ? s : 0.0, config); });
  }

  template <typename Right>  // JointVector or JointMatrix
  Right operator*(const Right& right) const {
    if (undamped_) return cholesky_.solve(right);
    Right turned = eigen_.eigenvectors().transpose() * right;
    turned.array().colwise() *= inverted_.array();
    return eigen_.eigenvectors() * turned;
  }

 private:
  Eigen::LLT<JointMatrix> cholesky_;
  Eigen::SelfAdjointEigenSolver<JointMatrix> eigen_;
  JointVector inverted_;
  bool undamped_ = false;
};

/// What the levels so far left free: Q_{k-1} of (4.8).
struct Freedom {
  JointMatrix Q;
  bool whole = true;  ///< Q = I: no level was active yet
};

/// One level of the stack, reduced to its active rows: a row with activation 0 has no part in
/// (4.7) or (4.8), so leaving it out changes nothing.
class Level {
 public:
  void set(const Task& task, const Freedom& freedom, const JointVector& rho) {
    const Eigen::Index m = (task.activation.array() > 0.0).count();
    J_.resize(m, freedom.Q.cols());
    a_.resize(m);
    error_.resize(m);
    for (Eigen::Index i = 0, row = 0; row < m; ++i) {
      if (!(task.activation[i] > 0.0)) continue;
      J_.row(row) = task.jacobian.row(i);
      a_[row] = task.activation[i];
      error_[row++] = task.rate[i] - task.jacobian.row(i).dot(rho);
    }
    project(freedom);
  }

  /// The closing level: J = A = I, rate 0.
  void set_closing(const Freedom& freedom, const JointVector& rho) {
    J_.setIdentity(rho.size(), rho.size());
    a_.setOnes(rho.size());
    error_ = -rho;
    project(freedom);
  }

  bool active() const { return a_.size() > 0; }
  bool finite() const { return error_.allFinite() && std::isfinite(B_.squaredNorm()); }

  void factor(const Freedom& freedom, const SolverConfig& config) {
    // (B'B)^# B' = B' (BB')^# for every function of the eigenvalues: take the smaller of the two.
    by_rows_ = B_.rows() <= B_.cols();
    if (by_rows_) {
      gram_.noalias() = B_ * B_.transpose();
    } else {
      gram_.noalias() = B_.transpose() * B_;
    }
    inverse_.factor(gram_, config);
    weighted_by_Q_ = !freedom.whole;
    if (!weighted_by_Q_) return;
    const JointMatrix used = JointMatrix::Identity(B_.cols(), B_.cols()) - freedom.Q;
    if (by_rows_) gram_.noalias() = B_.transpose() * B_;
    gram_.noalias() += config.eta * used.transpose() * used;
    inverse_Q_.factor(gram_, config);
  }

  /// Q X^{#,A,I} W error, with W = X X^{#,A,Q}: the term that (4.8) adds.
  JointVector term(const JointMatrix& Q) const {
    const JointVector weighted = a_.array().square() * error_.array();
    const JointVector wished =
        weighted_by_Q_ ? JointVector(inverse_Q_ * JointVector(X_.transpose() * weighted))
                       : apply(error_);
    return Q * apply(X_ * wished);
  }

  /// Q (I - X^{#,A,I} X)
  JointMatrix remaining(const JointMatrix& Q) const {
    JointMatrix AB = B_;  // X'AAX = B' A B
    AB.array().colwise() *= a_.array();
    if (by_rows_) return Q - Q * (B_.transpose() * (inverse_ * AB));
    return Q - Q * (inverse_ * JointMatrix(B_.transpose() * AB));
  }

 private:
  void project(const Freedom& freedom) {
    if (freedom.whole) {
      X_ = J_;
    } else {
      X_.noalias() = J_ * freedom.Q;
    }
    B_ = X_;
    B_.array().colwise() *= a_.array().sqrt();
  }

  /// X^{#,A,I} right
  JointVector apply(const JointVector& right) const {
    if (by_rows_) {
      const JointVector weighted = a_.array() * a_.array().sqrt() * right.array();
      return B_.transpose() * (inverse_ * weighted);
    }
    const JointVector weighted = a_.array().square() * right.array();
    return inverse_ * JointVector(X_.transpose() * weighted);
  }

  JointMatrix J_, X_, B_;  ///< active rows; J Q_{k-1}; sqrt(A) X
  JointVector a_, error_;  ///< activation; rate - J rho_{k-1}
  JointMatrix gram_;
  Inverse inverse_, inverse_Q_;  ///< of X'AX (or its rows' form), and with the cost of leaving Q
  bool by_rows_ = false;
  bool weighted_by_Q_ = false;
};

/// Adds one level's term to `rho` and takes what the level uses from the freedom: (4.8).
/// @return false, and nothing changed, where a number overflowed
bool add(Level& level, bool closing, const SolverConfig& config, const JointVector& qd_max,
         Freedom& freedom, JointVector& rho) {
  if (!level.finite()) return false;
  level.factor(freedom, config);
  const JointVector term = level.term(freedom.Q);
  const JointVector sum = rho + term;
  if (!sum.allFinite()) return false;
  if (!closing) {
    const JointMatrix remaining = level.remaining(freedom.Q);
    if (!remaining.allFinite()) return false;
    freedom.Q = remaining;
    freedom.whole = false;
  }
  if (qd_max.size() == 0) {
    rho = sum;
  } else {
    const JointVector low = -qd_max;
    rho = box::along(rho, box::share(rho, term, low, qd_max), term, low, qd_max);
  }
  return true;
}

}  // namespace

void solve(std::span<const Task> tasks, int n, const JointVector& qd_max,
           const SolverConfig& config, Solution& out) {
  static_assert(kMaxRows <= kMaxJoints, "a level's rows are kept in storage made for joints");
  Freedom freedom{.Q = JointMatrix::Identity(n, n)};
  JointVector rho = JointVector::Zero(n);
  Level level;
  out.levels = static_cast<int>(tasks.size());
  out.overflowed = 0;
  for (std::size_t k = 0; k <= tasks.size(); ++k) {
    const bool closing = k == tasks.size();
    if (closing) {
      level.set_closing(freedom, rho);
    } else {
      level.set(tasks[k], freedom, rho);
    }
    if (level.active() && !add(level, closing, config, qd_max, freedom, rho)) ++out.overflowed;
    out.rho[k] = rho;
  }
}

RowVector residual(const Task& task, const JointVector& qd) {
  return task.rate - task.jacobian * qd;
}

}  // namespace proxcgal
