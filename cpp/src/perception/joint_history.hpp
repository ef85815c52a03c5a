#pragma once
#include <array>

#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// Where the joints were in the last moments: a scan is placed where the arm was at its stamp.
class JointHistory {
 public:
  void push(double time, const JointVector& q);
  /// Linear between neighbours, the end value outside of what is kept.
  JointVector at(double time) const;

 private:
  // Half a second at 1 kHz and more: scans older than that are refused.
  static constexpr std::size_t kKept = 1024;
  std::array<double, kKept> time_{};
  std::array<JointVector, kKept> q_;
  std::size_t count_ = 0;  // ever pushed
  const JointVector& q(std::size_t back) const { return q_[(count_ - 1 - back) % kKept]; }
  double t(std::size_t back) const { return time_[(count_ - 1 - back) % kKept]; }
};

}  // namespace proxcgal::detail
