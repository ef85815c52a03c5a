#pragma once
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// `kFast` and `kPaper` give the same answer; the second is the literal algorithm over CGAL's own
/// queries, kept as oracle and as the baseline of every timing.
enum class Method : std::uint8_t { kFast, kPaper };

/// When a point that passed the filter is believed.
enum class Confirmation : std::uint8_t {
  kOff,
  kZones,  ///< a neighbouring zone of the same scan sees a similar range
  kScans,  ///< the zone saw a similar range in one of the last two scans as well
};

/// How the robot's own body is told from obstacles: Algorithm 1 of [WA], and what noise adds.
struct FilterConfig {
  double tolerance = 0.02;     ///< [m] epsilon of Algorithm 1
  double sigmas = 4.0;         ///< the tolerance is at least this many sigma(range)
  double min_hit = 0.005;      ///< [m] nearer hits are the sensor's own mounting
  bool surface_margin = true;  ///< also drop what lies that near to any link's surface
  Confirmation confirmation = Confirmation::kOff;
  double z_min = -kInfinity;  ///< [m] world height below which points are cropped (floor)
  void validate() const;
};

/// Algorithm 1 of [WA]: clears `keep` where any link's first hit along a point's ray explains it.
///
/// @param origins_W  ray origins, (n, 3): the emitters
/// @param points_W   measured points, (n, 3)
/// @param tolerance  (n,) how far from the first hit a point may be and still be body [m]
/// @param min_hit    hits nearer to the emitter are the emitter's own mounting [m]
/// @param keep       (n,) cleared where the point is the robot's own body, else left as it is
void remove_body(const Robot& robot, const Posture& posture, const PointsRef& origins_W,
                 const PointsRef& points_W, std::span<const double> tolerance, double min_hit,
                 Method method, std::span<bool> keep);

/// Clears `keep` where a point is nearer than its tolerance to any link's surface. Ours: Algorithm
/// 1 alone lets noisy self-hits through (docs/sources.md).
///
/// Every point that Algorithm 1 drops is dropped here too: the hit that explains it is within its
/// tolerance.
/// @param steps  tree nodes and leaves that may be looked at, counted down where given; points that
///               they do not suffice for are kept
/// @return       did they suffice?
bool remove_near_surface(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         std::span<const double> tolerance, std::span<bool> keep,
                         std::int64_t* steps = nullptr);

}  // namespace proxcgal
