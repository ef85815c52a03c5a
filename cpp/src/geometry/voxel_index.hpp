#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// Which slot holds a voxel's point: open addressing in storage made at set-up.
class VoxelIndex {
 public:
  using Key = std::uint64_t;
  static constexpr int kNone = -1;

  /// @param slots  the most voxels that will be in at a time
  VoxelIndex(double voxel, int slots)
      : per_metre_(1.0 / voxel),
        keys_(std::bit_ceil(static_cast<std::size_t>(slots) * 2U)),
        slots_(keys_.size(), kNone),
        mask_(keys_.size() - 1) {}

  Key key(const Vector3& point_W) const {
    Key key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double cell = std::floor(point_W[axis] * per_metre_);
      const auto index = static_cast<std::int64_t>(std::clamp(cell, -kHalf, kHalf - 1.0));
      key = key << 21U | (static_cast<Key>(index) & 0x1FFFFFU);
    }
    return key;
  }
  int find(Key key) const { return slots_[place(key)]; }
  void put(Key key, int slot) {
    const std::size_t at = place(key);
    keys_[at] = key;
    slots_[at] = slot;
  }
  void erase(Key key) {
    std::size_t hole = place(key);
    // What was put behind the hole because of it moves up: no search ends too early.
    for (std::size_t at = (hole + 1) & mask_; slots_[at] != kNone; at = (at + 1) & mask_) {
      const std::size_t home = hash(keys_[at]);
      if (((at - home) & mask_) < ((at - hole) & mask_)) continue;
      keys_[hole] = keys_[at];
      slots_[hole] = slots_[at];
      hole = at;
    }
    slots_[hole] = kNone;
  }

 private:
  static constexpr double kHalf = 1048576.0;  // voxels to either side of the origin
  std::size_t hash(Key key) const {
    key = (key ^ key >> 32U) * 0x9E3779B97F4A7C15U;  // golden ratio: neighbours far apart
    return static_cast<std::size_t>(key >> 32U) & mask_;
  }
  /// Where the key is, or would be put.
  std::size_t place(Key key) const {
    std::size_t at = hash(key);
    while (slots_[at] != kNone && keys_[at] != key) at = (at + 1) & mask_;
    return at;
  }

  double per_metre_;
  std::vector<Key> keys_;
  std::vector<int> slots_;
  std::size_t mask_;
};

}  // namespace proxcgal::detail
