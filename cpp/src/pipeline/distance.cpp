#include "proxcgal/pipeline/distance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/frames.hpp"
#include "geometry/point_chunk.hpp"

namespace proxcgal {
namespace {

/// Calls `visit(link)` for the links asked for, all where none are named.
template <class Visit>
void for_links(const Robot& robot, std::span<const int> links, Visit&& visit) {
  if (links.empty()) {
    for (int link = 0; link < robot.n_links(); ++link) visit(link);
  } else {
    for (const int link : links) visit(link);
  }
}

/// Algorithm 2 of [WA], literally, on CGAL's own queries.
ClosestPair closest_pair_paper(const Robot& robot, const Posture& posture,
                               const PointsRef& points_W, const SearchOptions& options) {
  ClosestPair best;
  double current_minimum = options.within * options.within;
  for_links(robot, options.links, [&](int link) {
    const MeshTree& tree = robot.tree(link);
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
    const Pose T_LW = T_WL.inverse();
    for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
      const Vector3 point_W = points_W.row(i).transpose();
      const Vector3 point_L = T_LW * point_W;
      const double squared = tree.reference_squared_distance(point_L);
      if (squared < current_minimum) {
        current_minimum = squared;
        best.link = link;
        // Slip of the text mended: the environment point first, then the robot point nearest to it.
        best.obstacle_W = point_W;
        best.point = static_cast<int>(i);
        best.surface_W = T_WL * tree.reference_closest(point_L).point_L;
      }
    }
  });
  if (best.found()) best.distance = std::sqrt(current_minimum);
  return best;
}

/// The same answer with one bound carried across points and links: what cannot be nearer than the
/// best so far is not asked.
class Search {
 public:
  Search(const Robot& robot, const Posture& posture, const PointsRef& points_W,
         const SearchOptions& options)
      : robot_(robot),
        posture_(posture),
        points_W_(points_W),
        links_(options.links),
        steps_(options.steps != nullptr ? *options.steps : any_),
        squared_(options.within * options.within) {}

  /// Begins where the pair was a moment ago: in a cloud of the same sensors the same row is near.
  void start_at(const ClosestPair& before) {
    const Eigen::Index row = std::min<Eigen::Index>(before.point, points_W_.rows() - 1);
    // Neither has moved far, most likely; where they have, nothing is found and `start` begins.
    const double guess = (points_W_.row(row).transpose() - before.surface_W).norm() + kMoved;
    visit(row, before.link, std::min(squared_, guess * guess));
  }

  /// Begins where a good bound is likely: of a few points across the cloud, the one nearest to the
  /// box of a link.
  void start() {
    const Eigen::Index stride = std::max<Eigen::Index>(points_W_.rows() / kSample, 1);
    const SampledRef sample(points_W_.data(), (points_W_.rows() + stride - 1) / stride, 3,
                            Eigen::OuterStride<>(stride * points_W_.outerStride()));
    int likeliest = -1;
    Eigen::Index at = 0;
    float least = INFINITY;
    for (Eigen::Index begin = 0; begin < sample.rows(); begin += PointChunk::kRoom) {
      const PointChunk chunk(sample, begin);
      for_links(robot_, links_, [&](int link) {
        const auto [row, bound] = chunk.likeliest(box_of(link));
        if (likeliest >= 0 && !(bound < least)) return;
        likeliest = link;
        at = (begin + row) * stride;
        least = bound;
      });
    }
    visit(at, likeliest);
  }

  /// Asks every point that may be nearer.
  ClosestPair finish() {
    // A bound of nothing cannot be lowered.
    for (Eigen::Index begin = 0; begin < points_W_.rows() && left_out_.squared > 0.0;
         begin += PointChunk::kRoom) {
      const PointChunk chunk(points_W_, begin);
      for_links(robot_, links_, [&](int link) {
        const LinkBox box = box_of(link);
        const float limit = detail::not_below(std::min(squared_, left_out_.squared));
        if (!chunk.may_reach(box, limit)) return;
        PointChunk::Limits limits;
        limits.fill(limit);
        PointChunk::Rows rows;
        const int n = steps_ > 0 ? chunk.near_rows(box, limits, rows) : 0;
        for (int i = 0; i < n; ++i) visit(begin + rows[static_cast<std::size_t>(i)], link);
        if (steps_ <= 0) bound_from_below(chunk, link);
      });
    }
    if (left_out_.squared < squared_) take_left_out();
    if (best_.found()) best_.distance = std::sqrt(squared_);
    return best_;
  }

 private:
  using PointChunk = detail::PointChunk;
  using LinkBox = detail::LinkBox;
  using SampledRef = Eigen::Map<const Points, 0, Eigen::OuterStride<>>;
  static constexpr Eigen::Index kSample = 128;
  static constexpr double kMoved = 0.02;  // [m] how far a link moves from tick to tick, generously
  static constexpr int kLastSteps = 64;   // for all of a chunk, once its share is spent

  /// Where the distance may be least of what the steps did not suffice for.
  struct LeftOut {
    double squared = kInfinity;  // [m^2] from below
    int link = -1;
    Eigen::Index point = -1;
  };

  LinkBox box_of(int link) const { return {robot_.tree(link).bounds(), T_WL(link)}; }
  const Pose& T_WL(int link) const { return posture_.T_WL[static_cast<std::size_t>(link)]; }
  Vector3 to_link(const Vector3& point_W, int link) const {
    return detail::into(T_WL(link), point_W);
  }

  void visit(Eigen::Index point, int link) { visit(point, link, squared_); }
  void visit(Eigen::Index point, int link, double squared_bound) {
    const Vector3 point_W = points_W_.row(point).transpose();
    const auto found = robot_.tree(link).nearest(to_link(point_W, link), squared_bound, &steps_);
    if (!found) return;
    squared_ = found->squared_distance;
    best_.link = link;
    best_.point = static_cast<int>(point);
    best_.obstacle_W = point_W;
    best_.surface_W = T_WL(link) * found->point_L;
  }

  /// All points of a chunk by one question: none is nearer than their middle is, less its reach.
  void bound_from_below(const PointChunk& chunk, int link) {
    const auto [center_W, reach] = chunk.ball();
    const double middle =
        std::sqrt(robot_.tree(link).squared_lower_bound(to_link(center_W, link), kLastSteps));
    const double open = std::max(middle - reach, 0.0);
    const auto [row, box_squared] = chunk.likeliest(box_of(link));
    const double squared = std::max(open * open, static_cast<double>(box_squared));
    if (squared < left_out_.squared) left_out_ = {squared, link, chunk.begin() + row};
  }

  /// The answer is a bound from below, with the points where it may be reached.
  void take_left_out() {
    const Vector3 point_W = points_W_.row(left_out_.point).transpose();
    std::int64_t steps = kLastSteps;
    const auto near =
        robot_.tree(left_out_.link).nearest(to_link(point_W, left_out_.link), kInfinity, &steps);
    squared_ = left_out_.squared;
    best_.lower_bound = true;
    best_.link = left_out_.link;
    best_.point = static_cast<int>(left_out_.point);
    best_.obstacle_W = point_W;
    if (near) best_.surface_W = T_WL(left_out_.link) * near->point_L;
  }

  const Robot& robot_;
  const Posture& posture_;
  const PointsRef& points_W_;
  std::span<const int> links_;
  std::int64_t any_ = std::numeric_limits<std::int64_t>::max();
  std::int64_t& steps_;  // left
  LeftOut left_out_;
  ClosestPair best_;
  double squared_;  // of the best, or what it must be under
};

ClosestPair closest_pair_fast(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                              const SearchOptions& options) {
  if (points_W.rows() == 0) return {};
  const std::span<const int> links = options.links;
  const int link = options.before.link;
  Search search(robot, posture, points_W, options);
  const bool asked = links.empty() || std::find(links.begin(), links.end(), link) != links.end();
  if (options.before.found() && asked) search.start_at(options.before);
  search.start();
  return search.finish();
}

}  // namespace

ClosestPair closest_pair(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         Method method, const SearchOptions& options) {
  const auto search = method == Method::kPaper ? closest_pair_paper : closest_pair_fast;
  return search(robot, posture, points_W, options);
}

void closest_pairs(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                   std::span<const int> links, std::span<ClosestPair> pairs, std::int64_t* steps) {
  std::size_t row = 0;
  for_links(robot, links, [&](int link) {
    ClosestPair& pair = pairs[row++];
    pair = closest_pair_fast(robot, posture, points_W,
                             {.links = std::span(&link, 1), .before = pair, .steps = steps});
  });
}

SignedDistance signed_distance(const Robot& robot, const Posture& posture, const Vector3& point_W) {
  constexpr double touching = 1e-9;  // [m] nearer than this the direction to the surface is noise
  constexpr double step = 1e-6;      // [m] off the surface, to see which side is out
  SignedDistance best;
  for (int link = 0; link < robot.n_links(); ++link) {
    const MeshTree& tree = robot.tree(link);
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
    const Vector3 point_L = detail::into(T_WL, point_W);
    const bool inside = tree.inside(point_L);
    if (!inside && best.distance <= 0.0) continue;
    const auto found = tree.nearest(point_L, inside ? kInfinity : best.distance * best.distance);
    if (!found) continue;
    const double length = std::sqrt(found->squared_distance);
    const double distance = inside ? -length : length;
    if (!(distance < best.distance)) continue;
    Vector3 normal_L = (point_L - found->point_L) / (inside ? -length : length);
    if (length < touching) {
      // On the surface: its own normal there, towards where it goes round less.
      const auto corner = [&](int k) {
        return Vector3(tree.vertices_L().row(tree.triangles()(found->triangle, k)).transpose());
      };
      normal_L = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      const double ahead = std::abs(tree.winding_number(found->point_L + step * normal_L));
      const double behind = std::abs(tree.winding_number(found->point_L - step * normal_L));
      if (ahead > behind) normal_L = -normal_L;
    }
    best = {distance, link, T_WL * found->point_L, T_WL.linear() * normal_L};
  }
  return best;
}

}  // namespace proxcgal
