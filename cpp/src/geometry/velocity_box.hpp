#pragma once
#include <algorithm>
#include <cmath>

#include "proxcgal/types.hpp"

/// Straight steps inside bounds on the joint velocities: what saturation (solve) and limits
/// (command) share. A whole step is shortened, never one joint of it.
namespace proxcgal::box {

/// A joint that moves by less, against the fastest, moves by rounding alone: standing at its
/// bound it must not stop the others.
inline constexpr double kNegligible = 1e-10;

/// The largest s in [0, 1] for which low <= from + s step <= high, for a `from` between them.
inline double share(const JointVector& from, const JointVector& step, const JointVector& low,
                    const JointVector& high) {
  const double negligible = kNegligible * (from.cwiseAbs().maxCoeff() + step.cwiseAbs().maxCoeff());
  double s = 1.0;
  for (Eigen::Index j = 0; j < step.size(); ++j) {
    if (std::abs(step[j]) <= negligible) continue;
    const double room = step[j] > 0.0 ? high[j] - from[j] : from[j] - low[j];
    s = std::min(s, room / std::abs(step[j]));
  }
  return std::max(s, 0.0);
}

/// The largest s in [0, 1] for which from + s step is between the bounds, or -1 where none is:
/// as `share`, for a `from` that may be outside.
inline double last_inside(const JointVector& from, const JointVector& step, const JointVector& low,
                          const JointVector& high) {
  const double negligible = kNegligible * (from.cwiseAbs().maxCoeff() + step.cwiseAbs().maxCoeff());
  double enter = 0.0;
  double leave = 1.0;
  for (Eigen::Index j = 0; j < step.size(); ++j) {
    if (std::abs(step[j]) <= negligible) {
      if (from[j] < low[j] - negligible || from[j] > high[j] + negligible) return -1.0;
      continue;
    }
    const double at_low = (low[j] - from[j]) / step[j];
    const double at_high = (high[j] - from[j]) / step[j];
    enter = std::max(enter, std::min(at_low, at_high));
    leave = std::min(leave, std::max(at_low, at_high));
  }
  return enter <= leave ? leave : -1.0;
}

/// from + s step, with what is left of the rounding cut off.
inline JointVector along(const JointVector& from, double s, const JointVector& step,
                         const JointVector& low, const JointVector& high) {
  return (from + s * step).cwiseMax(low).cwiseMin(high);
}

inline bool contains(const JointVector& low, const JointVector& high, const JointVector& qd) {
  return (qd.array() >= low.array()).all() && (qd.array() <= high.array()).all();
}

}  // namespace proxcgal::box
