#include <cmath>

#include "kernels.hpp"

namespace proxcgal::detail {

SurfacePoint Bvh::nearest(const Vector3& point, double squared_bound, std::int64_t& steps) const {
  Nearest best;
  best.squared = squared_bound;
  kernels().nearest(view(), point.data(), best, steps);
  return {best.squared, Vector3(best.point), best.triangle};
}

double Bvh::squared_lower_bound(const Vector3& point, int steps) const {
  return kernels().squared_lower_bound(view(), point.data(), steps);
}

bool Bvh::within(const Vector3& point, double squared_radius, std::int64_t& steps) const {
  return kernels().within(view(), point.data(), squared_radius, steps);
}

bool Bvh::any_hit(const Vector3& origin, const Vector3& direction, double t_min,
                  double t_max) const {
  // Searched with an open end: what is found at t_max itself still counts.
  const double end = std::nextafter(t_max, kInfinity);
  return kernels().any_hit(view(), origin.data(), direction.data(), t_min, end) < end;
}

double Bvh::first_hit(const Vector3& origin, const Vector3& direction, double t_min) const {
  return kernels().first_hit(view(), origin.data(), direction.data(), t_min, kInfinity);
}

}  // namespace proxcgal::detail
