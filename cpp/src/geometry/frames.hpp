#pragma once
#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// A point of the world in the frame that has pose T_WL.
inline Vector3 into(const Pose& T_WL, const Vector3& point_W) {
  return T_WL.linear().transpose() * (point_W - T_WL.translation());
}

}  // namespace proxcgal::detail
