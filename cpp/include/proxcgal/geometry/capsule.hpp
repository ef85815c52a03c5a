#pragma once
#include "proxcgal/types.hpp"

namespace proxcgal {

/// All that lies within `radius` of a segment. A segment of no length makes it a sphere.
struct Capsule {
  Vector3 start = Vector3::Zero(), end = Vector3::Zero();  ///< [m] of its axis, rounding left out
  double radius = 0.0;                                     ///< [m]

  Vector3 at(double share) const { return start + share * (end - start); }
};

/// Where two capsules are nearest to one another.
struct CapsulePair {
  double distance = kInfinity;          ///< [m] between the surfaces, negative inside
  double share_a = 0.0, share_b = 0.0;  ///< along each axis, 0 at the start, 1 at the end
  Vector3 axis_a = Vector3::Zero();     ///< nearest points of the axes
  Vector3 axis_b = Vector3::Zero();     //
  Vector3 normal = Vector3::UnitZ();    ///< unit, from b to a
  Vector3 surface_a = Vector3::Zero();  ///< witnesses: `distance` apart along the normal
  Vector3 surface_b = Vector3::Zero();  //
};

/// Velocities of the two ends of a capsule's axis; between them they vary linearly.
struct CapsuleMotion {
  Vector3 start = Vector3::Zero(), end = Vector3::Zero();  ///< [m/s]

  Vector3 at(double share) const { return start + share * (end - start); }
};

/// The point of a segment nearest to `point`, as a share of its length: 0 where it has none.
double nearest_share(const Vector3& point, const Vector3& start, const Vector3& end);

/// Distance of two capsules, [WT] Fig. 1: that of their axes less both radii.
///
/// Exact in all degenerate cases: axes without length, parallel, crossing, identical. Where axes
/// are parallel and many pairs of points are nearest, it is one of them. Where they meet there is
/// no direction between them: the normal is across both. An end that is no number gives a distance
/// that is none. Allocates nothing.
CapsulePair closest(const Capsule& a, const Capsule& b);

/// How fast the distance falls [m/s]: positive where the nearest points move towards each other.
double closing_speed(const CapsulePair& pair, const CapsuleMotion& a, const CapsuleMotion& b);

/// Velocity of a point projected on the direction to the axis of a capsule, [WT] 2.2 and Fig. 3:
/// positive towards it. On the axis itself, where there is no direction, all of the speed.
/// @param velocity  of the point; less that of the capsule there, where both count [m/s]
double approach_speed(const Vector3& point, const Vector3& velocity, const Capsule& to);

}  // namespace proxcgal
