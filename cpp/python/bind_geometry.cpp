#include <nanobind/stl/tuple.h>

#include <cmath>

#include "convert.hpp"
#include "proxcgal/geometry/mesh_tree.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

auto closest(const MeshTree& tree, nb::handle points) {
  const PointsArgument points_L(points, "points_L");
  const Eigen::Index n = points_L().rows();
  Eigen::VectorXd distance(n);
  Points surface(n, 3);
  Eigen::VectorXi triangle(n);
  {
    const nb::gil_scoped_release release;
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto found = tree.nearest(points_L().row(i).transpose());
      distance[i] = std::sqrt(found->squared_distance);
      surface.row(i) = found->point_L.transpose();
      triangle[i] = found->triangle;
    }
  }
  return std::make_tuple(distance, surface, triangle);
}

Eigen::VectorXd first_hit(const MeshTree& tree, nb::handle origins, nb::handle directions) {
  const PointsArgument origins_L(origins, "origins_L"), directions_L(directions, "directions_L");
  if (origins_L().rows() != directions_L().rows()) {
    throw GeometryError("origins_L has " + std::to_string(origins_L().rows()) +
                        " rows and directions_L " + std::to_string(directions_L().rows()) +
                        ": one direction for each origin is needed");
  }
  Eigen::VectorXd length(origins_L().rows());
  for (Eigen::Index i = 0; i < length.size(); ++i) {
    if (directions_L().row(i).norm() == 0.0) {
      throw GeometryError("directions_L row " + std::to_string(i) +
                          " is zero: a ray needs a direction");
    }
  }
  const nb::gil_scoped_release release;
  for (Eigen::Index i = 0; i < length.size(); ++i) {
    // Unit length, so that the parameter of the hit is its distance.
    const Vector3 direction = directions_L().row(i).normalized();
    length[i] = tree.first_hit(origins_L().row(i).transpose(), direction);
  }
  return length;
}

Eigen::VectorXd winding_number(const MeshTree& tree, nb::handle points) {
  const PointsArgument points_L(points, "points_L");
  Eigen::VectorXd out(points_L().rows());
  const nb::gil_scoped_release release;
  for (Eigen::Index i = 0; i < out.size(); ++i)
    out[i] = tree.winding_number(points_L().row(i).transpose());
  return out;
}

auto distance(const MeshTree& tree, const MeshTree& other, nb::handle T_LO, double bound) {
  require_bound(bound);
  const Pose pose = pose_from(T_LO, "T_LO");
  Vector3 here, there;
  const nb::gil_scoped_release release;
  const double d = tree.distance(other, pose, bound, &here, &there);
  if (!std::isfinite(d)) here = there = Vector3::Constant(std::nan(""));
  return std::make_tuple(d, here, there);
}

}  // namespace

void bind_geometry(nb::module_& m) {
  nb::class_<MeshTree>(m, "MeshTree",
                       "Surface of one rigid link: indexed once, queried often. All of it is in "
                       "the link frame L.\n\n"
                       "Args:\n    vertices_L: (v, 3) [m].\n    triangles: (f, 3) vertex rows, any "
                       "integer type; faces without area are left out.\n\n"
                       "Raises:\n    GeometryError: no face with area, a vertex that is not "
                       "finite, an index outside [0, v).")
      .def(
          "__init__",
          [](MeshTree* self, nb::handle vertices, nb::handle triangles) {
            const PointsArgument vertices_L(vertices, "vertices_L");
            new (self) MeshTree(vertices_L(), triangles_from(triangles));
          },
          "vertices_L"_a, "triangles"_a)
      .def_prop_ro("vertices_L", &MeshTree::vertices_L, "(v, 3) [m].")
      .def_prop_ro("triangles", &MeshTree::triangles,
                   "(f, 3) vertex rows, without the faces that have no area.")
      .def_prop_ro("degenerate_triangles", &MeshTree::degenerate_triangles,
                   "How many faces were left out for having no area.")
      .def("closest", &closest, "points_L"_a,
           "Distance (n,) [m], surface point (n, 3) and triangle (n,) nearest to each of the (n, "
           "3) points, in the link frame.")
      .def("first_hit", &first_hit, "origins_L"_a, "directions_L"_a,
           "Length (n,) [m] of each ray up to its first hit, inf where nothing is hit. Directions "
           "(n, 3) need not be unit.")
      .def("winding_number", &winding_number, "points_L"_a,
           "(n,) how often the surface goes round each of the (n, 3) points: 1 or -1 inside a "
           "closed one, 0 outside, in between where it is open.")
      .def("distance", &distance, "other"_a, "T_LO"_a, "bound"_a = kInfinity,
           "Exact distance to another surface whose frame has pose T_LO (4, 4) in this one's: "
           "(distance [m], point on this in L,\n"
           "point on the other in its frame). 0 where they cross; inf and NaN points where it is "
           "not below `bound`.");
}

}  // namespace proxcgal::binding
