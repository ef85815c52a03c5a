#pragma once
#include <array>

#include "proxcgal/pipeline/limit_config.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// Does the arm do what it is commanded?
///
/// Over a window each joint's mean velocity must lie between the least and the largest command of
/// that window and of the arm's delay before it: an arm that follows with any delay up to the
/// configured one does. A drive that is off, a brake or a collision does not. Storage is fixed.
class ArmFollowing {
 public:
  /// @param tolerance  share of the largest command by which the mean may lie outside; infinite:
  ///                   never judged
  ArmFollowing(const LimitConfig& config, double period, double tolerance);

  /// @param time  [s] of the controller's own clock
  /// @param q     (n,) measured
  /// @return      the joint that does not follow, -1 for none
  int judge(double time, const JointVector& q) const;
  /// What this tick commands, to be followed from now on.
  void command(double time, const JointVector& q, const JointVector& qd);
  /// Forgets the past: the arm was moved by other means.
  void clear() { count_ = 0; }

 private:
  struct Entry {
    double time;
    JointVector q, qd;
  };
  static constexpr std::size_t kKept = 256;
  const Entry& entry(std::size_t back) const { return kept_[(count_ - 1 - back) % kKept]; }

  double tolerance_;
  double window_, delay_;  // [s]
  std::array<Entry, kKept> kept_;
  std::size_t count_ = 0;  // ever added
};

}  // namespace proxcgal::detail
