#include <nanobind/stl/tuple.h>

#include <algorithm>

#include "bind_fields.hpp"
#include "proxcgal/pipeline/sense.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

Points zone_directions(const SensorModel& model) {
  const Sense sense(model);
  Points directions(kZones, 3);
  for (int zone = 0; zone < kZones; ++zone)
    directions.row(zone) = sense.point(zone, 1.0).transpose();
  return directions;
}

/// What one packet says, zone by zone: (zones, points, ranges, standard deviations).
std::tuple<Eigen::VectorXi, Points, Eigen::VectorXd, Eigen::VectorXd> sense(
    const SensorModel& model, const Scan& scan) {
  SensedPoints sensed;
  Sense{model}(scan, sensed);
  Eigen::VectorXi zones(sensed.count);
  Points points_S(sensed.count, 3);
  Eigen::VectorXd ranges(sensed.count), sigmas(sensed.count);
  for (int i = 0; i < sensed.count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    zones[i] = sensed.zone[at];
    points_S.row(i) = sensed.point_S[at].transpose();
    ranges[i] = sensed.range[at];
    sigmas[i] = sensed.sigma[at];
  }
  return {zones, points_S, ranges, sigmas};
}

Scan scan_from(int sensor, std::uint32_t counter, double stamp, nb::handle ranges,
               nb::handle status) {
  Scan scan;
  scan.sensor = sensor;
  scan.counter = counter;
  scan.stamp = stamp;
  const Eigen::VectorXd values = vector_from(ranges, "ranges", kZones, Take::kConvert, false);
  std::copy(values.begin(), values.end(), scan.ranges.begin());
  nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu> codes;
  if (!nb::try_cast(status, codes, false) || codes.ndim() != 1 || codes.shape(0) != kZones) {
    throw GeometryError("status must be a (64,) uint8 array: one target status code for each zone");
  }
  std::copy(codes.data(), codes.data() + kZones, scan.status.begin());
  return scan;
}

Skin joined(const Skin& a, const Skin& b) {
  if (!(a.model == b.model))
    throw ConfigError(
        "skins with different sensor models cannot be joined: give both the same model");
  Skin skin = a;
  skin.mounts.insert(skin.mounts.end(), b.mounts.begin(), b.mounts.end());
  return skin;
}

}  // namespace

void bind_sense(nb::module_& m) {
  nb::class_<Scan>(m, "Scan", "One sensor's packet, as a VL53L8CX board sends it.")
      .def(
          "__init__",
          [](Scan* self, int sensor, std::uint32_t counter, double stamp, nb::handle ranges,
             nb::handle status) {
            new (self) Scan(scan_from(sensor, counter, stamp, ranges, status));
          },
          "sensor"_a, "counter"_a, "stamp"_a, "ranges"_a, "status"_a,
          "Args: sensor, its row of the skin; counter, 32 bit, advances with every measurement; "
          "stamp [s] when it was measured; ranges (64,) [m] along z; status (64,) uint8 codes.\n"
          "Raises: GeometryError for a wrong shape or type; bad values are findings of the tick.")
      .def_ro("sensor", &Scan::sensor, "Row of the skin.")
      .def_ro("counter", &Scan::counter, "Advances with every measurement.")
      .def_ro("stamp", &Scan::stamp, "[s] when it was measured, on the caller's clock.")
      .def_prop_ro(
          "ranges",
          [](const Scan& s) {
            return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(s.ranges.data(), kZones));
          },
          "(64,) [m] along the sensor's z axis.")
      .def_prop_ro(
          "status",
          [](const Scan& s) {
            return Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>(
                Eigen::Map<const Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>>(s.status.data(),
                                                                                 kZones));
          },
          "(64,) target status, 5 is valid.");
  bind_fields<SensorModel>(m)
      .def("sigma", &SensorModel::sigma, "range"_a, "Standard deviation of a range [m].")
      .def(
          "__eq__",
          [](const SensorModel& self, const nb::object& other) {
            SensorModel model;
            return nb::try_cast(other, model) && self == model;
          },
          nb::sig("def __eq__(self, other: object, /) -> bool"));
  m.def("zone_directions", &zone_directions, "model"_a,
        "(64, 3) point of each zone at range 1 m, in the sensor's frame: [WA] eq. (1). Zone = 8 "
        "row + column.");
  m.def(
      "sense", &sense, "model"_a, "scan"_a,
      "The sense stage alone, of the zones with a target inside the workspace: zones (n,), points "
      "(n, 3) in the sensor's frame, ranges (n,) along the rays and their standard deviations "
      "(n,) [m].");
  nb::class_<Mount>(m, "Mount", "Where one sensor sits: its frame in the link's, z looking out.")
      .def(
          "__init__",
          [](Mount* self, std::string name, std::string link, nb::handle T_LS) {
            new (self) Mount{std::move(name), std::move(link), pose_from(T_LS, "T_LS")};
          },
          "name"_a, "link"_a, "T_LS"_a,
          "Args: name; link, by its name; T_LS (4, 4), the sensor's frame in the link's [m].\n"
          "Raises: GeometryError for what is no pose.")
      .def_ro("name", &Mount::name, "For messages and pictures.")
      .def_ro("link", &Mount::link, "Name of the link that carries it.")
      .def_prop_ro(
          "T_LS", [](const Mount& mount) { return to_matrix(mount.T_LS); }, "(4, 4).");
  nb::class_<Skin>(
      m, "Skin", "The sensors of a robot, row by row, and the model they share. Skins join with +.")
      .def(
          "__init__",
          [](Skin* self, std::vector<Mount> mounts, const SensorModel& model) {
            new (self) Skin{std::move(mounts), model};
          },
          "mounts"_a, "model"_a = SensorModel{})
      .def_prop_ro(
          "mounts", [](const Skin& skin) { return skin.mounts; }, "Where each sensor sits.")
      .def_prop_ro(
          "model", [](const Skin& skin) { return skin.model; }, "Of every one of them.")
      .def("__len__", [](const Skin& skin) { return skin.mounts.size(); })
      .def("__add__", &joined, "other"_a);
}

}  // namespace proxcgal::binding
