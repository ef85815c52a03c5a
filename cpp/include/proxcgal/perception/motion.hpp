#pragma once
#include <array>
#include <memory>
#include <span>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// How the closest obstacle's velocity is estimated, the x_o of [WA] eq. (4). Ours: the paper has
/// the term and no way to get it.
struct MotionConfig {
  double window = 0.22;
  double radius = 0.15;
  double confidence = 4.0;
  double max_speed = 2.0;
};

template <>
inline constexpr auto fields<MotionConfig> =
    field_table("MotionConfig",
                "How the closest obstacle's velocity is estimated, the x_o of [WA] eq. (4); ours.",
                field(&MotionConfig::window, "window", "s", above(0).at_most(1),
                      "Age up to which scans count; the default holds four at 15 Hz."),
                field(&MotionConfig::radius, "radius", "m", above(0).at_most(1),
                      "Radius of the patch of surface round the closest point."),
                field(&MotionConfig::confidence, "confidence", "", at_least(0),
                      "Standard deviations below which a velocity counts as none."),
                field(&MotionConfig::max_speed, "max_speed", "m/s", at_least(0),
                      "Speed to which the estimate is limited."));

/// The last scans' points with their stamps, and the velocity of a patch of them.
///
/// The points slide over a surface that stands still as the arm moves, so no centroid is taken: a
/// smooth patch is fitted that moves as a whole, and what only slides along it shows no velocity.
/// Along a flat surface none can be seen; there the estimate is the part along the normal, all
/// that eq. (4) takes.
class Motion {
 public:
  /// @param sensors  that will see
  Motion(const MotionConfig& config, std::size_t sensors);
  ~Motion();
  Motion(Motion&&) noexcept;

  /// The points that one new scan added to the cloud.
  void see(double stamp, std::span<const Vector3> points_W);
  /// Velocity of what is round a point [m/s], zero where none can be told from noise.
  /// @param time     [s] now
  /// @param anchor_W  the closest obstacle point
  Vector3 velocity_W(double time, const Vector3& anchor_W);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
