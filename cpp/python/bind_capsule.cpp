#include <nanobind/stl/pair.h>

#include <utility>

#include "convert.hpp"
#include "proxcgal/geometry/capsule.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

/// No farther than points may be: squares would overflow, and a distance be wrong in silence.
Vector3 place_from(nb::handle value, const char* name) {
  Vector3 place = vector3_from(value, name);
  if (place.cwiseAbs().maxCoeff() <= kFarthest) return place;
  throw GeometryError(std::string(name) + " is farther than 1e9 m from the origin");
}

Capsule make_capsule(nb::handle start, nb::handle end, double radius) {
  if (!(radius >= 0.0 && radius <= kFarthest))
    throw GeometryError("radius is " + std::to_string(radius) + ", must be 0 to 1e9 m");
  return {place_from(start, "start"), place_from(end, "end"), radius};
}

/// (n, 7) rows of start, end, radius.
std::vector<Capsule> capsules_from(nb::handle value, const char* name) {
  const ArrayView view = array_from(value, name, "(n, 7) float64", Take::kConvert);
  require_shape(view, name, "(n, 7): start, end, radius", {-1, 7});
  std::vector<Capsule> capsules(view.shape(0));
  for (std::size_t i = 0; i < capsules.size(); ++i) {
    const double* row = view.data() + 7 * i;
    capsules[i] = {Vector3(row), Vector3(row + 3), row[6]};
    // maxCoeff of a NaN is anything: finiteness by itself.
    const Eigen::Map<const Eigen::Matrix<double, 7, 1>> numbers(row);
    if (!(numbers.allFinite() && numbers.cwiseAbs().maxCoeff() <= kFarthest && row[6] >= 0.0))
      throw GeometryError(std::string(name) + " row " + std::to_string(i) +
                          " must be finite and at most 1e9 m, its radius 0 m or more");
  }
  return capsules;
}

nb::ndarray<nb::numpy, double> distances(nb::handle a, nb::handle b) {
  const std::vector<Capsule> first = capsules_from(a, "a"), second = capsules_from(b, "b");
  if (first.size() != second.size())
    throw GeometryError("a has " + std::to_string(first.size()) + " rows and b " +
                        std::to_string(second.size()) + ": as many are needed");
  auto* data = new double[first.size()];
  const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  for (std::size_t i = 0; i < first.size(); ++i) data[i] = closest(first[i], second[i]).distance;
  return {data, {first.size()}, owner};
}

}  // namespace

void bind_capsule(nb::module_& m) {
  nb::class_<Capsule>(m, "Capsule",
                      "All that lies within a radius of a segment. Source: [WT] Fig. 1.")
      .def(
          "__init__",
          [](Capsule* self, nb::handle start, nb::handle end, double radius) {
            new (self) Capsule(make_capsule(start, end, radius));
          },
          "start"_a, "end"_a, "radius"_a,
          "Args: start, end (3,) of the axis [m]; radius [m].\nRaises: GeometryError.")
      .def_prop_ro(
          "start", [](const Capsule& c) { return Vector3(c.start); }, "(3,) [m]")
      .def_prop_ro(
          "end", [](const Capsule& c) { return Vector3(c.end); }, "(3,) [m]")
      .def_ro("radius", &Capsule::radius, "[m]");
  nb::class_<CapsulePair>(m, "CapsulePair", "Where two capsules are nearest to one another.")
      .def_ro("distance", &CapsulePair::distance, "[m] of the surfaces, negative inside.")
      .def_prop_ro(
          "surface_a", [](const CapsulePair& p) { return Vector3(p.surface_a); },
          "(3,) witness on the first [m].")
      .def_prop_ro(
          "surface_b", [](const CapsulePair& p) { return Vector3(p.surface_b); },
          "(3,) witness on the second [m].")
      .def_prop_ro(
          "normal", [](const CapsulePair& p) { return Vector3(p.normal); },
          "(3,) unit, from the second to the first.")
      .def_prop_ro(
          "shares", [](const CapsulePair& p) { return std::make_pair(p.share_a, p.share_b); },
          "Of the axes' lengths, 0 at the start: where their nearest points are.");
  m.def("closest_capsules", &closest, "a"_a, "b"_a,
        "Distance of two capsules with its witnesses; exact in all degenerate cases.\n\n"
        "Source: [WT] Fig. 1: the distance of the axes less both radii.");
  m.def("capsule_distances", &distances, "a"_a, "b"_a,
        "Distances of n pairs of capsules, (n,) [m], negative inside.\n\n"
        "Args: a, b (n, 7): start, end, radius of each [m].\nRaises: GeometryError.");
  m.def(
      "closing_speed",
      [](const CapsulePair& pair, nb::handle start_a, nb::handle end_a, nb::handle start_b,
         nb::handle end_b) {
        return closing_speed(pair, {vector3_from(start_a, "start_a"), vector3_from(end_a, "end_a")},
                             {vector3_from(start_b, "start_b"), vector3_from(end_b, "end_b")});
      },
      "pair"_a, "start_a"_a, "end_a"_a, "start_b"_a, "end_b"_a,
      "How fast the distance of a pair falls [m/s], by the velocities (3,) of the axes' ends.");
  m.def(
      "approach_speed",
      [](nb::handle point, nb::handle velocity, const Capsule& to) {
        return approach_speed(vector3_from(point, "point"), vector3_from(velocity, "velocity"), to);
      },
      "point"_a, "velocity"_a, "to"_a,
      "Velocity of a point towards a capsule's axis [m/s], positive towards. Source: [WT] 2.2.");
}

}  // namespace proxcgal::binding
