#pragma once
#include <array>
#include <cmath>

#include "proxcgal/pipeline/memory.hpp"
#include "voxel_index.hpp"

namespace proxcgal::detail {

/// What a scan says of one point.
enum class Verdict : std::uint8_t { kNothing, kThrough, kThere };

/// The rules by which a scan tells that a remembered point is gone, or measured again; `Memory`
/// states them.
class SightLines {
 public:
  /// @param voxel  [m] edge
  SightLines(const ViewModel& model, double voxel);

  /// Is a point before the sensor, inside its field of view? @param point_S  [m]
  bool in_view(float px, float py, float pz) const {
    const float wide = border_[kSide] * pz;
    return static_cast<bool>(static_cast<int>(pz > kNearest) &
                             static_cast<int>(std::abs(px) <= wide) &
                             static_cast<int>(std::abs(py) <= wide));
  }
  /// @param point_S  inside the field of view
  /// @param voxel    that the point lies in
  Verdict judge(const ScanView& view, float px, float py, float pz, const VoxelIndex& index,
                VoxelIndex::Key voxel) const;
  /// The same of a point anywhere in the world.
  Verdict judge(const ScanView& view, const Vector3& point_W, const VoxelIndex& index) const;

 private:
  static constexpr int kSide = 8;
  static constexpr float kNearest = 0.02F;  // [m] along z: nearer than that no zone tells a range

  float margin(double along_z) const;
  bool passes(const ScanView& view, int zx, int zy, float pz, const VoxelIndex& index,
              VoxelIndex::Key voxel) const;
  bool beyond(const ScanView& view, float tx, float ty, int zx, int zy, float depth) const;

  ViewModel model_;
  double voxel_;  // [m]
  // Where the zones look, as tangents.
  std::array<float, kSide> middle_;
  std::array<float, kSide + 1> border_;
};

}  // namespace proxcgal::detail
