#pragma once
#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// How the points of a cloud move. Refers to what it is made of.
class ObstacleVelocities {
 public:
  /// @param velocities_W  no row: not at all; one for all points, or one for each [m/s]
  explicit ObstacleVelocities(const PointsRef& velocities_W) : velocities_W_(velocities_W) {}
  /// One velocity for what is round a point, none for the rest.
  ObstacleVelocities(const PointsRef& velocity_W, const PointsRef& cloud_W, const Vector3& about_W,
                     double radius)
      : velocities_W_(velocity_W), cloud_W_(&cloud_W), about_W_(about_W), radius_(radius) {}

  Vector3 of(int point) const {
    if (velocities_W_.rows() == 0) return Vector3::Zero();
    if (cloud_W_ != nullptr && !((cloud_W_->row(point).transpose() - about_W_).norm() <= radius_))
      return Vector3::Zero();
    return velocities_W_.row(velocities_W_.rows() == 1 ? 0 : point).transpose();
  }
  double fastest() const {
    return velocities_W_.rows() == 0 ? 0.0 : velocities_W_.rowwise().norm().maxCoeff();
  }

 private:
  const PointsRef& velocities_W_;
  const PointsRef* cloud_W_ = nullptr;
  Vector3 about_W_ = Vector3::Zero();
  double radius_ = 0.0;
};

}  // namespace proxcgal::detail
