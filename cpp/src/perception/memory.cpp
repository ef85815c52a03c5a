#include "proxcgal/perception/memory.hpp"

#include <algorithm>
#include <vector>

#include "geometry/frames.hpp"
#include "geometry/point_chunk.hpp"
#include "geometry/voxel_index.hpp"
#include "sight_lines.hpp"

namespace proxcgal {
namespace {

constexpr std::int64_t kPairsAView = 64;    // that a scan costs whatever there is to look at
constexpr std::int64_t kPairsATick = 8192;  // (point, scan) that one tick looks at

}  // namespace

struct Memory::Impl {
  MemoryConfig config;
  detail::SightLines sight;
  detail::VoxelIndex index;

  // One row each, side by side; the first `count` are in use.
  int count = 0;
  int held = -1;
  int nearest = -1;  // to the arm, when room was last made
  Points points_W;
  std::vector<float> x, y, z;
  std::vector<double> stamp, tolerance;
  std::vector<PointOrigin> origin;
  std::vector<detail::VoxelIndex::Key> key;
  std::vector<int> through;           // scans that saw through it
  std::vector<double> through_stamp;  // [s] of the last of them
  std::uint64_t version = 0;

  std::vector<ScanView> views;  // the newest of each sensor
  std::vector<int> next;        // row to look at next in it, counted down; -1: all done
  std::size_t turn = 0;         // sensor whose scan is worked off next

  // Of `make_room`.
  std::vector<float> bound;  // [m^2] to the arm, from below
  std::vector<float> sorted;
  float limit = INFINITY;  // [m^2] what is farther was nothing to keep in this tick
  Points fresh_W = Points::Zero(kZones, 3);
  std::array<float, kZones> fresh_bound{};

  Impl(const MemoryConfig& c, const ViewModel& m, std::size_t sensors)
      : config(c),
        sight(m, c.voxel),
        index(c.voxel, c.max_points),
        views(sensors),
        next(sensors, -1) {
    const auto n = static_cast<std::size_t>(config.max_points);
    points_W.setZero(config.max_points, 3);
    for (auto* floats : {&x, &y, &z, &bound, &sorted}) floats->resize(n);
    for (auto* doubles : {&stamp, &tolerance, &through_stamp}) doubles->resize(n);
    origin.resize(n);
    key.resize(n);
    through.resize(n);
  }

  void write(int row, const RememberedPoint& from, bool was_through, double now) {
    const auto at = static_cast<std::size_t>(row);
    points_W.row(row) = from.point_W.transpose();
    x[at] = static_cast<float>(from.point_W.x());
    y[at] = static_cast<float>(from.point_W.y());
    z[at] = static_cast<float>(from.point_W.z());
    stamp[at] = from.stamp;
    tolerance[at] = from.tolerance;
    origin[at] = from.origin;
    through[at] = was_through ? 1 : 0;
    through_stamp[at] = was_through ? now : -kInfinity;
    ++version;
  }

  void remove(int row) {
    const auto at = static_cast<std::size_t>(row), last = static_cast<std::size_t>(count - 1);
    index.erase(key[at]);
    for (int* stays : {&held, &nearest}) {
      if (*stays == row) *stays = -1;
      if (*stays == count - 1) *stays = row;
    }
    if (at != last) {
      points_W.row(row) = points_W.row(count - 1);
      for (auto* floats : {&x, &y, &z, &bound}) (*floats)[at] = (*floats)[last];
      for (auto* doubles : {&stamp, &tolerance, &through_stamp}) (*doubles)[at] = (*doubles)[last];
      origin[at] = origin[last];
      key[at] = key[last];
      through[at] = through[last];
      index.put(key[at], row);
    }
    --count;
    ++version;
  }

  /// Squared distance from each row to the arm's boxes, from below.
  template <class PointsLike>
  static void bounds(const PointsLike& rows_W, const Robot& robot, const Posture& posture,
                     float* out) {
    for (Eigen::Index begin = 0; begin < rows_W.rows(); begin += detail::PointChunk::kRoom) {
      const detail::PointChunk chunk(rows_W, begin);
      std::fill_n(out + begin, chunk.count(), INFINITY);
      for (int link = 0; link < robot.n_links(); ++link) {
        const detail::LinkBox box(robot.tree(link).bounds(),
                                  posture.T_WL[static_cast<std::size_t>(link)]);
        detail::PointChunk::Limits squared;
        chunk.squared_bounds(box, squared);
        for (int i = 0; i < chunk.count(); ++i)
          out[begin + i] = std::min(out[begin + i], squared[static_cast<std::size_t>(i)]);
      }
    }
  }

  /// Sets `nearest`; squared distance to the arm [m^2]. Asks the likeliest row first, then each
  /// that its `bound` leaves open.
  double find_nearest(const Robot& robot, const Posture& posture, std::int64_t* steps) {
    double squared = kInfinity;
    const auto ask = [&](int row) {
      const Vector3 point_W = points_W.row(row).transpose();
      for (int link = 0; link < robot.n_links(); ++link) {
        const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
        const auto found = robot.tree(link).nearest(detail::into(T_WL, point_W), squared, steps);
        if (!found) continue;
        squared = found->squared_distance;
        nearest = row;
      }
    };
    nearest = -1;
    ask(static_cast<int>(std::min_element(bound.begin(), bound.begin() + count) - bound.begin()));
    for (int row = 0; row < count && (steps == nullptr || *steps >= 0); ++row)
      if (static_cast<double>(bound[static_cast<std::size_t>(row)]) < squared) ask(row);
    return squared;
  }

  /// Forgets the farther half; of what is equally far as much as is needed. Boxes say what is far,
  /// but the nearest point is asked for itself: many others may lie inside a box, off its link.
  void make_room(const Robot& robot, const Posture& posture, std::int64_t* steps) {
    const auto rows_W = points_W.topRows(count);
    bounds(rows_W, robot, posture, bound.data());
    const double reach = find_nearest(robot, posture, steps);
    std::copy_n(bound.begin(), count, sorted.begin());
    const auto middle = sorted.begin() + count / 2;
    std::nth_element(sorted.begin(), middle, sorted.begin() + count);
    limit = *middle;
    const int enough = count / 2;
    for (const bool equal : {false, true}) {
      for (int row = count - 1; row >= 0 && count > enough; --row) {
        const float squared = bound[static_cast<std::size_t>(row)];
        if (row == held || row == nearest) continue;
        if (equal ? squared == limit : squared > limit) remove(row);
      }
    }
    // Rounded up: what comes next may be nearer than the nearest, and yet outside of all boxes.
    limit = std::max(limit, std::nextafter(static_cast<float>(reach), INFINITY));
  }

  /// @param points  at most kZones
  void leave(std::span<const RememberedPoint> points, const ScanView& now, const Robot& robot,
             const Posture& posture, std::int64_t* steps) {
    std::array<const RememberedPoint*, kZones> fresh;
    std::array<bool, kZones> was_through;
    int n = 0;
    for (const RememberedPoint& point : points) {
      const detail::Verdict verdict = sight.judge(now, point.point_W, index);
      const bool seen_through = verdict == detail::Verdict::kThrough;
      if (verdict == detail::Verdict::kThere || (seen_through && config.clear_scans == 1)) continue;
      was_through[static_cast<std::size_t>(n)] = seen_through;
      fresh[static_cast<std::size_t>(n++)] = &point;
    }
    const bool tight = count + n > config.max_points;
    if (tight) {
      for (int i = 0; i < n; ++i)
        fresh_W.row(i) = fresh[static_cast<std::size_t>(i)]->point_W.transpose();
      bounds(fresh_W.topRows(n), robot, posture, fresh_bound.data());
    }
    for (int i = 0; i < n; ++i) {
      const auto at = static_cast<std::size_t>(i);
      // Farther than what was kept when room was made a moment ago, and than the nearest of it.
      if (tight && fresh_bound[at] > limit) continue;
      const auto voxel = index.key(fresh[at]->point_W);
      int row = index.find(voxel);
      if (row != detail::VoxelIndex::kNone) {
        if (fresh[at]->stamp < stamp[static_cast<std::size_t>(row)]) continue;
      } else {
        if (count == config.max_points) {
          make_room(robot, posture, steps);
          if (fresh_bound[at] > limit || count == config.max_points) continue;
        }
        row = count++;
        key[static_cast<std::size_t>(row)] = voxel;
        index.put(voxel, row);
      }
      write(row, *fresh[at], was_through[at], now.stamp);
    }
  }

  void work_off(const ScanView& view, int& row, std::int64_t& left) {
    const Eigen::Matrix3f R = view.T_WS.linear().transpose().cast<float>();
    const Eigen::Vector3f t = view.T_WS.translation().cast<float>();
    constexpr int block = 16;
    left -= kPairsAView;
    // Downwards: what takes a removed row's place was looked at already.
    row = std::min(row, count - 1);
    while (row >= 0 && left > 0) {
      const int begin = std::max(row - block + 1, 0), n = row - begin + 1;
      std::array<float, block> px, py, pz;
      std::array<int, block> in;
      for (int i = 0; i < n; ++i) {
        const auto at = static_cast<std::size_t>(begin + i), to = static_cast<std::size_t>(i);
        const float dx = x[at] - t.x(), dy = y[at] - t.y(), dz = z[at] - t.z();
        px[to] = R(0, 0) * dx + R(0, 1) * dy + R(0, 2) * dz;
        py[to] = R(1, 0) * dx + R(1, 1) * dy + R(1, 2) * dz;
        pz[to] = R(2, 0) * dx + R(2, 1) * dy + R(2, 2) * dz;
        in[to] = static_cast<int>(sight.in_view(px[to], py[to], pz[to]));
      }
      for (int i = n - 1; i >= 0; --i) {
        const auto to = static_cast<std::size_t>(i);
        if (in[to] == 0) continue;
        const auto at = static_cast<std::size_t>(begin + i);
        take(begin + i, view, sight.judge(view, px[to], py[to], pz[to], index, key[at]));
      }
      left -= n;
      row = begin - 1;
    }
  }

  void take(int row, const ScanView& view, detail::Verdict verdict) {
    const auto at = static_cast<std::size_t>(row);
    if (!(view.stamp > stamp[at])) return;  // an older scan says nothing against a newer point
    if (verdict == detail::Verdict::kThere) {
      remove(row);
    } else if (verdict == detail::Verdict::kThrough && view.stamp > through_stamp[at]) {
      through_stamp[at] = view.stamp;
      if (++through[at] >= config.clear_scans) remove(row);
    }
  }
};

Memory::Memory(const MemoryConfig& config, const ViewModel& model, std::size_t sensors)
    : impl_(std::make_unique<Impl>(config, model, sensors)) {}
Memory::~Memory() = default;
Memory::Memory(Memory&&) noexcept = default;

void Memory::leave(std::span<const RememberedPoint> points, const ScanView& now, const Robot& robot,
                   const Posture& posture, std::int64_t* steps) {
  Impl& me = *impl_;
  for (std::size_t begin = 0; begin < points.size(); begin += kZones)
    me.leave(points.subspan(begin, std::min<std::size_t>(kZones, points.size() - begin)), now,
             robot, posture, steps);
}

void Memory::see(std::size_t sensor, const ScanView& view) {
  impl_->views[sensor] = view;
  // A round that is not done goes on with the new scan: from the first row again, it might never
  // come to the last.
  if (impl_->next[sensor] < 0) impl_->next[sensor] = impl_->count - 1;
}

void Memory::update(double time) {
  Impl& me = *impl_;
  me.limit = INFINITY;
  for (int row = me.count - 1; row >= 0; --row) {
    if (time - me.stamp[static_cast<std::size_t>(row)] > me.config.memory_s) me.remove(row);
  }
  std::int64_t left = kPairsATick;
  for (std::size_t looked = 0; looked < me.next.size() && left > 0; ++looked) {
    int& row = me.next[me.turn];
    if (row >= 0) me.work_off(me.views[me.turn], row, left);
    if (row < 0) me.turn = (me.turn + 1) % me.next.size();
  }
}

void Memory::forget(std::span<const bool> gone) {
  for (int row = impl_->count - 1; row >= 0; --row) {
    if (gone[static_cast<std::size_t>(row)]) impl_->remove(row);
  }
}

void Memory::hold(int row) { impl_->held = row < impl_->count ? row : -1; }
int Memory::held() const { return impl_->held; }

Eigen::Map<const Points> Memory::points_W() const {
  return {impl_->points_W.data(), impl_->count, 3};
}
std::span<const PointOrigin> Memory::origins() const {
  return {impl_->origin.data(), static_cast<std::size_t>(impl_->count)};
}
std::span<const double> Memory::stamps() const {
  return {impl_->stamp.data(), static_cast<std::size_t>(impl_->count)};
}
std::span<const double> Memory::tolerances() const {
  return {impl_->tolerance.data(), static_cast<std::size_t>(impl_->count)};
}
std::uint64_t Memory::version() const { return impl_->version; }

}  // namespace proxcgal
