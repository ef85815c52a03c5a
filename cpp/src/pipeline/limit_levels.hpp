#pragma once
#include <memory>
#include <span>

#include "limit_least_distance.hpp"
#include "proxcgal/pipeline/limit.hpp"

namespace proxcgal::detail {

/// A row as the programmes take it: row qd >= least.
struct BoundRow {
  const JointVector* row = nullptr;
  double least = 0.0;
  bool binds = false;  ///< some velocity in the interval violates it
  int at = -1;         ///< its index in the programme solved last
};

/// What the programmes of one tick share.
struct Programme {
  const LimitState* state = nullptr;
  std::array<BoundRow, kMaxCaps> caps;
  int n_caps = 0;
  std::array<BoundRow, kMaxRetreats> retreats;  ///< least: the rate
  std::array<double, kMaxRetreats> weight, allowance;
  int n_retreats = 0;
};

/// The levels (2a), (2b) and (3). Each returns false where its programme found no point. A point
/// found fulfils (0) exactly; (1) as far as the solver's rounding goes.
class Levels {
 public:
  explicit Levels(int n);

  /// How much (2a) and (2b) weigh motion. @param stand  in [0, 1]: pinched
  void calm(double stand);
  /// Least over the interval of the largest violation less its row's allowance.
  bool least_violation(Programme& programme, const JointVector& near, JointVector& qd);
  /// Least weighted sum of squares; no violation less allowance over `most`.
  bool least_squares(Programme& programme, const JointVector& near, double most, JointVector& qd);
  /// Nearest to `target` in `factor_` with the rates of `least`.
  bool nearest(Programme& programme, const JointVector& target,
               const std::array<double, kMaxRetreats>& least, JointVector& qd);
  /// Of the least squares solved last: share of the retreat demands that is not balanced by joints.
  double contradiction(const Programme& programme, const JointVector& qd) const;

  /// W of (3) = L L'. @return false where W is not finite: then L = I
  bool weigh(std::span<const Task> tasks, const LimitConfig& config);

  int joint_row(int joint, bool high) const {
    return (high ? at_high_ : at_low_)[static_cast<std::size_t>(joint)];
  }
  const LeastDistance& joints() const { return *joints_; }
  int iterations = 0;
  int solved = 0;

 private:
  void begin(LeastDistance& solver, int variables, Programme& programme, const JointVector& centre,
             double scale);
  bool finish(LeastDistance& solver, const Programme& programme, const JointVector& centre,
              double scale, JointVector& qd);

  int n_;
  std::unique_ptr<LeastDistance> joints_, slacks_;
  JointMatrix L_, L_inverse_;
  std::array<int, kMaxJoints> at_low_{}, at_high_{};
  std::array<int, kMaxRetreats> at_most_{};
  JointVector scratch_;
  double leeway_ = 0.0;  // [m/s] of (2b) over what (2a) found
  double motion_ = 0.0;  // [m/s per rad/s] square root of the weight of motion in (2a) and (2b)
};

}  // namespace proxcgal::detail
