#include "limit_least_distance.hpp"

#include <algorithm>
#include <cmath>
#include <eiquadprog/eiquadprog-rt.hpp>

namespace proxcgal::detail {
namespace {

constexpr int kMaxIterations = 200;   // each drops at most as many rows as there are variables
constexpr double kTiny = 1e-12;       // a row of a smaller norm is no row
constexpr double kFarthestRow = 1e8;  // [-] a point farther off than this is not looked for
constexpr double kViolation = 1e-10;  // accepted of a solution, in rows of unit norm
// The solver stops where the violations sum up to less than
// rows x epsilon x trace(H) x trace(J) x 100, and of H it reads the trace only.
constexpr double kTrace = 1e-4;

/// eiquadprog's real-time form: H = I is handed over as its inverse factor, and g = 0. With rows of
/// unit norm the new diagonal of R is the norm of the step z, over 1.5e-8 where the row is taken,
/// against R's norm of at most 1: the branch for degenerate rows is never entered.
template <int N, int M>
class Padded final : public LeastDistance {
 public:
  Padded() : LeastDistance(N, M) {
    C_ = CI_.data();
    least_ = ci0_.data();
    y_ = x_.data();
    lambda_ = multipliers_.data();
    solver_.setMaxIter(kMaxIterations);
    solver_.is_inverse_provided_ = true;
    hessian_.setZero();
    hessian_(0, 0) = kTrace;
    g0_.setZero();
    CI_.setZero();
    ci0_.setOnes();
    multipliers_.setZero();
  }

  bool solve() override {
    for (int i = rows_; i < used_; ++i) {
      CI_.row(i).setZero();
      ci0_[i] = 1.0;  // 0 y >= -1
    }
    used_ = rows_;
    solver_.m_J.setIdentity();
    x_.setZero();
    const auto status = solver_.solve_quadprog(hessian_, g0_, CE_, ce0_, CI_, ci0_, x_);
    iterations_ = solver_.getIteratios();
    multipliers_.setZero();
    if (!x_.allFinite()) return false;
    for (int k = 0; k < solver_.getActiveSetSize(); ++k)
      multipliers_[solver_.getActiveSet()[k]] = solver_.getLagrangeMultipliers()[k];
    if (status == eiquadprog::solvers::RT_EIQUADPROG_OPTIMAL) return true;
    // Rows that agree but for rounding look like a contradiction: the point is what counts.
    const double scale = 1.0 + x_.template lpNorm<Eigen::Infinity>();
    return (CI_ * x_ + ci0_).minCoeff() >= -kViolation * scale;
  }

 private:
  eiquadprog::solvers::RtEiquadprog<N, 0, M> solver_;
  Eigen::Matrix<double, N, N> hessian_;
  Eigen::Matrix<double, N, 1> g0_, x_;
  Eigen::Matrix<double, 0, N> CE_;
  Eigen::Matrix<double, 0, 1> ce0_;
  Eigen::Matrix<double, M, N> CI_;
  Eigen::Matrix<double, M, 1> ci0_, multipliers_;
};

}  // namespace

std::unique_ptr<LeastDistance> LeastDistance::make(int variables, int rows) {
  if (variables <= 8 && rows <= 64) return std::make_unique<Padded<8, 64>>();
  if (variables <= 16 && rows <= 80) return std::make_unique<Padded<16, 80>>();
  if (variables <= 24 && rows <= 80) return std::make_unique<Padded<24, 80>>();
  if (variables <= 32 && rows <= 112) return std::make_unique<Padded<32, 112>>();
  return std::make_unique<Padded<48, 128>>();
}

void LeastDistance::begin(int variables) {
  variables_ = std::min(variables, capacity_);
  rows_ = 0;
}

int LeastDistance::add(const Eigen::Ref<const Eigen::VectorXd>& coefficients, double least) {
  return add(coefficients, 0, 0.0, least);
}

int LeastDistance::add(const Eigen::Ref<const Eigen::VectorXd>& coefficients, int variable,
                       double coefficient, double least) {
  if (rows_ >= stride_) return -1;
  const double norm = std::hypot(coefficients.norm(), coefficient);
  if (!(norm > kTiny) || !std::isfinite(norm)) return -1;
  const int row = rows_++;
  for (int k = 0; k < capacity_; ++k)
    C_[k * stride_ + row] = k < coefficients.size() ? coefficients[k] / norm : 0.0;
  C_[variable * stride_ + row] += coefficient / norm;
  least_[row] = -std::clamp(least / norm, -kFarthestRow, kFarthestRow);
  norm_[row] = norm;
  used_ = std::max(used_, rows_);
  return row;
}

double LeastDistance::multiplier(int row) const {
  return row < 0 ? 0.0 : std::max(0.0, lambda_[row] / norm_[row]);
}

}  // namespace proxcgal::detail
