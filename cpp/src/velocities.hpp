#pragma once
#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// How the points of a cloud move: not at all, all alike, or each in its own way.
class Velocities {
 public:
  /// @param velocities_W  no row, one for all points, or one for each [m/s]; outlives this
  explicit Velocities(const PointsRef& velocities_W) : velocities_W_(velocities_W) {}

  Vector3 of(int point) const {
    if (velocities_W_.rows() == 0) return Vector3::Zero();
    return velocities_W_.row(velocities_W_.rows() == 1 ? 0 : point).transpose();
  }

 private:
  const PointsRef& velocities_W_;
};

}  // namespace proxcgal::detail
