#pragma once
#include <array>
#include <memory>
#include <span>

#include "proxcgal/fields.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Memory of points that left the sensors' view. Ours: [WA] forgets them at the next scan.
struct MemoryConfig {
  double memory_s = 2.0;
  double voxel = 0.05;
  int max_points = 1024;
  int clear_scans = 2;
};

template <>
inline constexpr auto fields<MemoryConfig> =
    field_table("MemoryConfig", "Memory of points that left the sensors' view; ours, not [WA]'s.",
                field(&MemoryConfig::memory_s, "memory_s", "s", at_least(0),
                      "Age at which a point is forgotten in any case; 0: none is kept."),
                field(&MemoryConfig::voxel, "voxel", "m", between(0.005, 0.5),
                      "Edge of a voxel, which holds one point, the newest."),
                // The one held, the nearest, and one that comes.
                field(&MemoryConfig::max_points, "max_points", "", between(3, 65536),
                      "Beyond this number, those farthest from the arm are forgotten."),
                field(&MemoryConfig::clear_scans, "clear_scans", "", between(1, 100),
                      "Scans that must see through a point before it counts as gone."));

/// The sensors' zones and noise, as far as memory reckons with them.
struct ViewModel {
  double field_of_view = 0.0;  ///< [rad] along one side, 8 zones
  double sigma_floor = 0.0;    ///< [m] of a range, at least
  double sigma_ratio = 0.0;    ///< [-] of the range, where that is more
  double sigmas = 4.0;         ///< noise reaches that far
};

/// One scan as a statement about space: the middle ray of each zone is empty up to where it ends.
struct ScanView {
  Pose T_WS = Pose::Identity();
  double stamp = -kInfinity;             ///< [s]
  std::array<float, kZones> empty_to{};  ///< [m] along z; 0 where the zone told nothing
  std::array<float, kZones> obstacle{};  ///< [m] along z, of what is in the cloud; 0 for none
};

/// A point, when and by whom it was measured.
struct RememberedPoint {
  Vector3 point_W = Vector3::Zero();  ///< as measured, never a voxel's middle
  double stamp = 0.0;                 ///< [s]
  double tolerance = 0.0;             ///< [m] nearer to the robot's surface it may be the robot
  PointOrigin origin;
};

/// Points that no current scan shows any more, in voxels of the world. Storage is made at set-up.
///
/// A point comes in when its sensor's next scan does not measure its voxel again. It leaves
///   - when a zone's ray passes its voxel and ends there: the scan's own point stands for it;
///   - when the rays round it end well beyond it, in `clear_scans` scans: it is gone;
///   - when it is `memory_s` old;
///   - when there are too many, and it is one of those farthest from the arm; never the nearest.
/// A zone is a cone of 5.6 deg of which only the middle ray is proved empty: a point is seen
/// through where all four rays next to it end beyond it, and the nearest passes its voxel; outside
/// the middle rays of the outermost zones, where there are no four, where its zone's own does. What
/// lies farther than half a voxel's diagonal from all rays of a sensor that stands still stays
/// until it is old: of voxels of 0.05 m that begins at 0.57 m, at the corners of zones.
///
/// Looking through the points is bounded in each tick, by 8192 pairs of point and scan: within six
/// ticks (the time from scan to scan at 15 Hz) some 45 sensors look at 1024 points. More sensors or
/// points take longer.
class Memory {
 public:
  /// @param sensors  that will see
  Memory(const MemoryConfig& config, const ViewModel& model, std::size_t sensors);
  ~Memory();
  Memory(Memory&&) noexcept;

  /// The points of a sensor's last scan, now that its next one is there.
  /// @param posture  of the arm: what is near to it is kept
  /// @param steps    that looking for the nearest may take where room is made, counted down where
  ///                 given; below 0 it was cut short, and the nearest may be forgotten
  void leave(std::span<const RememberedPoint> points, const ScanView& now, const Robot& robot,
             const Posture& posture, std::int64_t* steps = nullptr);
  /// A new scan: what it sees through, or sees again, is worked off in this tick and the next.
  void see(std::size_t sensor, const ScanView& view);
  /// Forgets what is too old, and what the scans have shown to be gone or there.
  void update(double time);
  /// Forgets the points that are marked. @param gone  one for each row of `points_W`
  void forget(std::span<const bool> gone);
  /// The point that must not go for want of room: the one that drives the arm; -1 for none.
  void hold(int row);
  int held() const;

  Eigen::Map<const Points> points_W() const;  ///< (n, 3)
  std::span<const PointOrigin> origins() const;
  std::span<const double> stamps() const;      ///< [s] when each was measured
  std::span<const double> tolerances() const;  ///< [m]
  /// Advances with every change of the rows.
  std::uint64_t version() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
