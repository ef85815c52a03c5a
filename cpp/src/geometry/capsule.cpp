#include "proxcgal/geometry/capsule.hpp"

#include <algorithm>
#include <cmath>

namespace proxcgal {
namespace {

constexpr double kOnAxis = 1e-9;  ///< [m] from the axis: nearer, rounding alone gives a direction

/// A pair of points of the two axes, and how far they are apart.
struct Candidate {
  double share_a = 0.0, share_b = 0.0;
  double distance = kInfinity;
};

void take_nearer(const Capsule& a, const Capsule& b, double share_a, double share_b,
                 Candidate& best) {
  const double distance = (a.at(share_a) - b.at(share_b)).stableNorm();
  // What is no number stays, whatever the next candidate is.
  if (distance >= best.distance || std::isnan(best.distance)) return;
  best = {share_a, share_b, distance};
}

/// Any unit vector across `direction`; across z where it has no length.
Vector3 across(const Vector3& direction) {
  Eigen::Index least = 0;
  direction.cwiseAbs().minCoeff(&least);
  const Vector3 normal = direction.cross(Vector3::Unit(least)).stableNormalized();
  return normal.squaredNorm() > 0.5 ? normal : Vector3::UnitX();
}

/// From b to a; where the axes meet, across both.
Vector3 normal_of(const Capsule& a, const Capsule& b, const Vector3& apart) {
  Vector3 normal = apart.stableNormalized();
  if (normal.squaredNorm() > 0.5) return normal;
  const Vector3 along_a = a.end - a.start, along_b = b.end - b.start;
  Vector3 both = along_a.cross(along_b).stableNormalized();
  if (both.squaredNorm() > 0.5) return both;
  return across(along_a.squaredNorm() >= along_b.squaredNorm() ? along_a : along_b);
}

}  // namespace

double nearest_share(const Vector3& point, const Vector3& start, const Vector3& end) {
  const Vector3 along = end - start;
  const double squared = along.squaredNorm();
  if (!(squared > 0.0)) return 0.0;
  return std::clamp((point - start).dot(along) / squared, 0.0, 1.0);
}

CapsulePair closest(const Capsule& a, const Capsule& b) {
  // The nearest pair has an end of an axis in it, or lies inside both: then it is where the common
  // perpendicular meets them. All five candidates are distances of real points, so that rounding
  // in one of them can never make the least too small.
  Candidate best;
  take_nearer(a, b, 0.0, nearest_share(a.start, b.start, b.end), best);
  take_nearer(a, b, 1.0, nearest_share(a.end, b.start, b.end), best);
  take_nearer(a, b, nearest_share(b.start, a.start, a.end), 0.0, best);
  take_nearer(a, b, nearest_share(b.end, a.start, a.end), 1.0, best);
  // By the cross product, not by the determinant of the scalar products: between nearly parallel
  // axes that loses twice the digits, and the foot would slide off sideways.
  const Vector3 along_b = b.end - b.start;
  const Vector3 perpendicular = (a.end - a.start).cross(along_b);
  const double squared = perpendicular.squaredNorm();
  if (squared > 0.0) {
    const double share_a = (b.start - a.start).cross(along_b).dot(perpendicular) / squared;
    if (share_a > 0.0 && share_a < 1.0)
      take_nearer(a, b, share_a, nearest_share(a.at(share_a), b.start, b.end), best);
  }
  CapsulePair pair;
  pair.share_a = best.share_a;
  pair.share_b = best.share_b;
  pair.axis_a = a.at(best.share_a);
  pair.axis_b = b.at(best.share_b);
  pair.normal = normal_of(a, b, pair.axis_a - pair.axis_b);
  pair.distance = best.distance - a.radius - b.radius;
  pair.surface_a = pair.axis_a - a.radius * pair.normal;
  pair.surface_b = pair.axis_b + b.radius * pair.normal;
  return pair;
}

double closing_speed(const CapsulePair& pair, const CapsuleMotion& a, const CapsuleMotion& b) {
  return -pair.normal.dot(a.at(pair.share_a) - b.at(pair.share_b));
}

double approach_speed(const Vector3& point, const Vector3& velocity, const Capsule& to) {
  const Vector3 way = to.at(nearest_share(point, to.start, to.end)) - point;
  const double length = way.stableNorm();
  if (length <= kOnAxis) return velocity.stableNorm();
  return way.dot(velocity) / length;
}

}  // namespace proxcgal
