// Algorithms 1 and 2 as a reader of the paper would write them on CGAL's AABB trees, with nothing
// of proxcgal's core but the file reader: what `method="paper"` must not be slower than.
//
//     bench_cgal_loops CELL.bin ...
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <cstdio>

#include "cell.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "samples.hpp"

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Point = Kernel::Point_3;
using Triangle = Kernel::Triangle_3;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, std::vector<Triangle>::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
using proxcgal::Pose;
using proxcgal::Vector3;
using proxcgal::bench::Cell;
using proxcgal::bench::Samples;

constexpr int kRuns = 5;

struct Link {
  std::vector<Triangle> triangles;
  Tree tree;
  Pose T_LW;
};

Point to_point(const Vector3& p) { return {p.x(), p.y(), p.z()}; }

std::vector<std::unique_ptr<Link>> links_of(const Cell& cell) {
  std::vector<std::unique_ptr<Link>> links;
  for (int row = 0; row < cell.robot->n_links(); ++row) {
    auto link = std::make_unique<Link>();
    const auto& mesh = cell.robot->tree(row);
    for (Eigen::Index f = 0; f < mesh.triangles().rows(); ++f) {
      const auto corner = [&](int k) {
        return to_point(mesh.vertices_L().row(mesh.triangles()(f, k)).transpose());
      };
      link->triangles.emplace_back(corner(0), corner(1), corner(2));
    }
    link->tree.insert(link->triangles.cbegin(), link->triangles.cend());
    link->tree.build();
    link->tree.accelerate_distance_queries();
    link->T_LW = cell.posture.T_WL[static_cast<std::size_t>(row)].inverse();
    links.push_back(std::move(link));
  }
  return links;
}

double first_hit(const Tree& tree, const Vector3& origin, const Vector3& direction) {
  const auto hit = tree.first_intersection(Kernel::Ray_3(
      to_point(origin), Kernel::Vector_3(direction.x(), direction.y(), direction.z())));
  if (!hit) return proxcgal::kInfinity;
  const auto along = [&](const Point& p) {
    return (Vector3(p.x(), p.y(), p.z()) - origin).dot(direction);
  };
  if (const auto* p = boost::get<Point>(&hit->first)) return along(*p);
  const auto* s = boost::get<Kernel::Segment_3>(&hit->first);
  return std::min(along(s->source()), along(s->target()));
}

void algorithm1(const Cell& cell, const std::vector<std::unique_ptr<Link>>& links,
                std::vector<std::uint8_t>& kept) {
  std::fill(kept.begin(), kept.end(), 1);
  for (const auto& link : links) {
    for (Eigen::Index i = 0; i < cell.points_W.rows(); ++i) {
      const Vector3 origin = link->T_LW * Vector3(cell.origins_W.row(i).transpose());
      const Vector3 point = link->T_LW * Vector3(cell.points_W.row(i).transpose());
      const double length = (point - origin).norm();
      if (!(length > cell.min_hit)) continue;
      const Vector3 direction = (point - origin) / length;
      const double hit =
          cell.min_hit + first_hit(link->tree, origin + cell.min_hit * direction, direction);
      if (std::abs(hit - length) <= cell.tolerance[static_cast<std::size_t>(i)])
        kept[static_cast<std::size_t>(i)] = 0;
    }
  }
}

double algorithm2(const Cell& cell, const std::vector<std::unique_ptr<Link>>& links) {
  double least = proxcgal::kInfinity;
  for (const auto& link : links) {
    for (Eigen::Index i = 0; i < cell.environment_W.rows(); ++i) {
      const Point point = to_point(link->T_LW * Vector3(cell.environment_W.row(i).transpose()));
      least = std::min(least, link->tree.squared_distance(point));
    }
  }
  return std::sqrt(least);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Both in turn, so that a machine whose speed drifts slows both: medians [us] and of the ratios.
template <class Alone, class Paper>
void compare(const std::string& cell, int algorithm, Alone&& alone, Paper&& paper) {
  std::vector<double> alone_us, paper_us, ratio;
  for (int run = -1; run < kRuns; ++run) {
    const double begin = Samples::cpu_us();
    alone();
    const double middle = Samples::cpu_us();
    paper();
    const double end = Samples::cpu_us();
    if (run < 0) continue;  // the first is the warm-up
    alone_us.push_back(middle - begin);
    paper_us.push_back(end - middle);
    ratio.push_back(paper_us.back() / alone_us.back());
  }
  std::printf("%s,%d,%.1f,%.1f,%.3f\n", cell.c_str(), algorithm, median(alone_us), median(paper_us),
              median(ratio));
}

}  // namespace

int main(int argc, char** argv) {
  using namespace proxcgal;  // NOLINT(google-build-using-namespace)
  std::puts("cell,algorithm,stand_alone_us,paper_us,ratio");
  for (int i = 1; i < argc; ++i) {
    const Cell cell = bench::read_cell(argv[i]);
    const auto links = links_of(cell);
    std::vector<std::uint8_t> kept(cell.kept.size());
    const auto keep = std::make_unique<bool[]>(kept.size());
    compare(
        cell.name, 1, [&] { algorithm1(cell, links, kept); },
        [&] {
          std::fill_n(keep.get(), kept.size(), true);
          remove_body(*cell.robot, cell.posture, cell.origins_W, cell.points_W, cell.tolerance,
                      cell.min_hit, Method::kPaper, {keep.get(), kept.size()});
        });
    double distance = 0.0;
    compare(
        cell.name, 2, [&] { distance = algorithm2(cell, links); },
        [&] {
          benchmark::DoNotOptimize(
              closest_pair(*cell.robot, cell.posture, cell.environment_W, Method::kPaper));
        });
    if (kept != cell.kept || std::abs(distance - cell.distance) > 1e-9) {
      std::fprintf(stderr, "bench_cgal_loops: %s: another answer\n", cell.name.c_str());
      return 1;
    }
  }
  return 0;
}
