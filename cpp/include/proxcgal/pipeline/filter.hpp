#pragma once
#include <array>

#include "proxcgal/fields.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// `kFast` and `kPaper` give the same answer; the second is the literal algorithm over CGAL's own
/// queries, kept as oracle and as the baseline of every timing.
enum class Method : std::uint8_t { kFast, kPaper };
template <>
inline constexpr auto choices<Method> =
    std::array{Choice{"fast", Method::kFast}, Choice{"paper", Method::kPaper}};

/// When a point that passed the filter is believed.
enum class Confirmation : std::uint8_t {
  kOff,
  kZones,  ///< a neighbouring zone of the same scan sees a similar range
  kScans,  ///< the zone saw a similar range in one of the last two scans as well
};

template <>
inline constexpr auto choices<Confirmation> =
    std::array{Choice{"off", Confirmation::kOff}, Choice{"zones", Confirmation::kZones},
               Choice{"scans", Confirmation::kScans}};

struct FilterConfig {
  double tolerance = 0.02;
  double sigmas = 4.0;
  double min_hit = 0.005;
  bool surface_margin = true;
  Confirmation confirmation = Confirmation::kOff;
  double z_min = -kInfinity;
};

template <>
inline constexpr auto fields<FilterConfig> = field_table(
    "FilterConfig",
    "How the robot's own body is told from obstacles ([WA] Algorithm 1, with a margin for noise).",
    field(&FilterConfig::tolerance, "tolerance", "m", at_least(0),
          "Distance to the first hit of its ray within which a point is body (epsilon of "
          "Algorithm 1)."),
    field(&FilterConfig::sigmas, "sigmas", "", at_least(0),
          "The tolerance is at least this many standard deviations of the range."),
    field(&FilterConfig::min_hit, "min_hit", "m", at_least(0),
          "Nearer hits are the sensor's own mounting."),
    field(&FilterConfig::surface_margin, "surface_margin",
          "Also remove points within the tolerance of any link's surface."),
    field(&FilterConfig::confirmation, "confirmation",
          "Confirmation that a point needs: none, a similar range in a neighbouring zone of its "
          "scan, or in its zone in one of the last two scans."),
    field(&FilterConfig::z_min, "z_min", "m", finite().or_minus_infinite(),
          "Points below this height in world are cropped (floor)."));

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
