#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>

#include "named_pair.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/filter.hpp"
#include "robot_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

void require_rows(const Eigen::Map<const Points>& points, const char* name) {
  if (points.rows() == 0)
    throw GeometryError(std::string(name) + " is empty: at least one point is needed");
}

nb::object remove_body_all(const Robot& robot, nb::handle q, nb::handle origins, nb::handle points,
                           nb::handle tolerance, double min_hit, const std::string& method) {
  const PointsArgument origins_W(origins, "origins_W"), points_W(points, "points_W");
  const Eigen::Index n = points_W().rows();
  if (origins_W().rows() != n) {
    throw GeometryError("origins_W has " + std::to_string(origins_W().rows()) +
                        " rows and points_W " + std::to_string(n) +
                        ": one origin for each point is needed");
  }
  double same = 0.0;
  const Eigen::VectorXd per_point =
      nb::try_cast(tolerance, same) ? Eigen::VectorXd::Constant(n, same)
                                    : vector_from(tolerance, "tolerance", n, Take::kConvert, false);
  for (const double value : per_point)
    require(std::isfinite(value) && value >= 0.0, "tolerance", value, "finite, 0 m or more");
  require(std::isfinite(min_hit) && min_hit >= 0.0, "min_hit", min_hit, "finite, 0 m or more");
  const Method how = choice_of<Method>(method, "method");
  const Posture posture = posture_at(robot, q);
  auto* keep = new bool[static_cast<std::size_t>(n)];
  std::fill_n(keep, n, true);
  const nb::capsule owner(keep, [](void* p) noexcept { delete[] static_cast<bool*>(p); });
  {
    const nb::gil_scoped_release release;
    const std::span<const double> tolerances(per_point.data(), static_cast<std::size_t>(n));
    remove_body(robot, posture, origins_W(), points_W(), tolerances, min_hit, how,
                {keep, static_cast<std::size_t>(n)});
  }
  return nb::cast(nb::ndarray<nb::numpy, bool>(keep, {static_cast<std::size_t>(n)}, owner));
}

constexpr std::int64_t kAnySteps = std::numeric_limits<std::int64_t>::max();

NamedPair closest_pair_all(const Robot& robot, nb::handle q, nb::handle points,
                           const std::string& method, std::optional<std::int64_t> steps) {
  const PointsArgument points_W(points, "points_W");
  require_rows(points_W(), "points_W");
  const Method how = choice_of<Method>(method, "method");
  const Posture posture = posture_at(robot, q);
  if (steps) require(*steps >= 0, "steps", *steps, "0 or more, or None");
  const nb::gil_scoped_release release;
  std::int64_t left = steps.value_or(kAnySteps);
  return named(robot, closest_pair(robot, posture, points_W(), how, {.steps = &left}));
}

std::vector<NamedPair> closest_pairs_all(const Robot& robot, nb::handle q, nb::handle points) {
  const PointsArgument points_W(points, "points_W");
  require_rows(points_W(), "points_W");
  const Posture posture = posture_at(robot, q);
  std::vector<ClosestPair> pairs(static_cast<std::size_t>(robot.n_links()));
  {
    const nb::gil_scoped_release release;
    closest_pairs(robot, posture, points_W(), {}, pairs);
  }
  std::vector<NamedPair> out;
  out.reserve(pairs.size());
  for (const ClosestPair& pair : pairs) out.push_back(named(robot, pair));
  return out;
}

/// Row by row; the links by name.
struct SignedDistances {
  Eigen::VectorXd distance;
  std::vector<std::string> link;
  Points surface_W, normal_W;
};

SignedDistances signed_distances(const Robot& robot, nb::handle q, nb::handle points) {
  const PointsArgument points_W(points, "points_W");
  const Posture posture = posture_at(robot, q);
  const Eigen::Index n = points_W().rows();
  SignedDistances out{Eigen::VectorXd(n), {}, Points(n, 3), Points(n, 3)};
  const nb::gil_scoped_release release;
  for (Eigen::Index i = 0; i < n; ++i) {
    const SignedDistance found = signed_distance(robot, posture, points_W().row(i).transpose());
    out.distance[i] = found.distance;
    out.link.push_back(robot.spec().links[static_cast<std::size_t>(found.link)].name);
    out.surface_W.row(i) = found.surface_W.transpose();
    out.normal_W.row(i) = found.normal_W.transpose();
  }
  return out;
}

/// Robot links against a surface that is not the robot's: the exact distance of meshes.
NamedPair mesh_distance(const Robot& robot, nb::handle q, const MeshTree& tree, nb::handle T_WO,
                        const std::optional<std::vector<std::string>>& links, double bound) {
  require_bound(bound);
  const Posture posture = posture_at(robot, q);
  const Pose pose = T_WO.is_none() ? Pose::Identity() : pose_from(T_WO, "T_WO");
  std::vector<int> rows;
  if (links) {
    for (const std::string& name : *links) rows.push_back(robot.link_row(name));
  } else {
    for (int link = 0; link < robot.n_links(); ++link) rows.push_back(link);
  }
  ClosestPair best;
  best.distance = bound;
  const nb::gil_scoped_release release;
  for (const int link : rows) {
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
    Vector3 here, there;
    const double d =
        robot.tree(link).distance(tree, T_WL.inverse() * pose, best.distance, &here, &there);
    if (!(d < best.distance)) continue;
    best.distance = d;
    best.link = link;
    best.surface_W = T_WL * here;
    best.obstacle_W = pose * there;
  }
  if (best.link < 0) best.distance = kInfinity;
  return named(robot, best);
}

Eigen::VectorXd self_distances(const Robot& robot, nb::handle q,
                               const std::vector<std::pair<int, int>>& pairs, double bound) {
  require_bound(bound);
  const Posture posture = posture_at(robot, q);
  for (const auto& [a, b] : pairs) {
    if (std::min(a, b) < 0 || std::max(a, b) >= robot.n_links()) {
      throw GeometryError("pairs names link rows " + std::to_string(a) + " and " +
                          std::to_string(b) + ": allowed are 0 to " +
                          std::to_string(robot.n_links() - 1));
    }
  }
  Eigen::VectorXd out(static_cast<Eigen::Index>(pairs.size()));
  const nb::gil_scoped_release release;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto [a, b] = pairs[i];
    const Pose T_ab = posture.T_WL[static_cast<std::size_t>(a)].inverse() *
                      posture.T_WL[static_cast<std::size_t>(b)];
    out[static_cast<Eigen::Index>(i)] = robot.tree(a).distance(robot.tree(b), T_ab, bound);
  }
  return out;
}

}  // namespace

void bind_pipeline(nb::module_& m) {
  nb::class_<NamedPair>(m, "ClosestPair",
                        "The nearest obstacle point and the robot surface point nearest to it.")
      .def_prop_ro(
          "distance", [](const NamedPair& p) { return p.pair.distance; }, "[m], unsigned.")
      .def_prop_ro(
          "lower_bound", [](const NamedPair& p) { return p.pair.lower_bound; },
          "The search was cut short: the true distance is at least `distance`.")
      .def_ro("link", &NamedPair::link, "Name of the link; empty where there is no pair.")
      .def_prop_ro(
          "surface_W", [](const NamedPair& p) { return p.pair.surface_W; },
          "(3,) on the robot [m].")
      .def_prop_ro(
          "obstacle_W", [](const NamedPair& p) { return p.pair.obstacle_W; }, "(3,) [m].")
      .def_prop_ro(
          "point", [](const NamedPair& p) { return p.pair.point; },
          "Row of the cloud, -1 where there was none.")
      .def("__repr__", [](const NamedPair& p) {
        return "ClosestPair(distance=" + std::to_string(p.pair.distance) + ", link='" + p.link +
               "')";
      });
  m.def(
      "remove_body", &remove_body_all, "robot"_a, "q"_a, "origins_W"_a, "points_W"_a,
      "tolerance"_a = 0.02, "min_hit"_a = 0.005, "method"_a = "fast",
      nb::sig("def remove_body(robot: Robot, q: object, origins_W: object, points_W: object, "
              "tolerance: object = 0.02, "
              "min_hit: float = 0.005, method: str = 'fast') -> numpy.typing.NDArray[numpy.bool_]"),
      "Algorithm 1 of [WA] alone, over all links: (n,) bool, True where a point is kept.\n\n"
      "A point is dropped when any link's first hit along its ray lies within the tolerance of "
      "it.\n\n"
      "Args:\n    origins_W: (n, 3) emitters [m].\n    points_W: (n, 3) measured points [m].\n    "
      "tolerance: epsilon [m], one or (n,).\n"
      "    min_hit: nearer hits are the emitter's own mounting [m].\n    method: 'fast', or "
      "'paper' for the literal algorithm.\n\n"
      "Raises:\n    GeometryError: wrong shape, or not finite.");
  m.def("closest_pair", &closest_pair_all, "robot"_a, "q"_a, "points_W"_a, "method"_a = "fast",
        "steps"_a = nb::none(),
        "Algorithm 2 of [WA], over all links: the nearest (cloud point, surface point).\n\n"
        "Args:\n    method: 'fast', or 'paper' for the literal algorithm.\n    steps: of 'fast', "
        "tree nodes and leaves that it may look at, as a tick does; past them the\n"
        "        distance is a lower bound, and marked so. None: as many as it takes.\n\n"
        "Raises:\n    GeometryError: empty cloud, wrong shape, or not finite.");
  m.def("closest_pairs", &closest_pairs_all, "robot"_a, "q"_a, "points_W"_a,
        "The nearest pair of each link, in the order of link_names.\n\n"
        "Args: q (n_q,); points_W (n, 3) [m].\n"
        "Raises: GeometryError for an empty cloud, a wrong shape, or what is not finite.");
  nb::class_<SignedDistances>(m, "SignedDistances",
                              "Distances with a sign, row by row of the points asked for.")
      .def_ro("distance", &SignedDistances::distance, "(n,) [m], negative inside a link.")
      .def_ro("link", &SignedDistances::link,
              "n names: the nearest link; inside, the one in which the point is deepest.")
      .def_ro("surface_W", &SignedDistances::surface_W, "(n, 3) nearest point of that link [m].")
      .def_ro("normal_W", &SignedDistances::normal_W,
              "(n, 3) unit, out of the link at `surface_W`: the way that leads out.");
  m.def("signed_distance", &signed_distances, "robot"_a, "q"_a, "points_W"_a,
        "Distance to the arm with its sign, and the way out, for each of the (n, 3) points.\n\n"
        "Inside is where a link's surface goes round the point more than half, by the generalized "
        "winding number:\ndrawn meshes are open at their flanges, and parts of theirs overlap. "
        "The distance is to the nearest surface\nthat is drawn, inner walls too. Asks every "
        "triangle of the links round a point: not for a control loop.\n\n"
        "Args:\n    q: (n_q,).\n    points_W: (n, 3) [m].\n\n"
        "Returns:\n    SignedDistances: distance, link, surface_W, normal_W.\n\n"
        "Raises:\n    GeometryError: wrong shape, or not finite.\n\n"
        "Source: Jacobson, Kavan & Sorkine-Hornung, SIGGRAPH 2013, for the sign.");
  m.def("mesh_distance", &mesh_distance, "robot"_a, "q"_a, "tree"_a, "T_WO"_a = nb::none(),
        "links"_a = nb::none(), "bound"_a = kInfinity,
        "Exact distance from the robot's meshes to another surface whose frame has pose T_WO in "
        "world. 0 where they cross;\n"
        "distance inf and link '' where nothing is nearer than `bound`. `point` is -1.\n\n"
        "Args: q (n_q,); tree, in its own frame; T_WO (4, 4), None for the world's; links, by "
        "name, None for all; bound [m].\n"
        "Raises: GeometryError for a wrong shape or no pose, ModelError for a link that is not "
        "there, ConfigError for a bound that is negative or NaN.");
  m.def("self_distances", &self_distances, "robot"_a, "q"_a, "pairs"_a, "bound"_a = kInfinity,
        "Exact distance [m] between the meshes of each pair of link rows, (len(pairs),); inf where "
        "it is not below `bound`.\n\n"
        "Args: q (n_q,); pairs of rows of link_names; bound [m].\n"
        "Raises: GeometryError for a row that is not there or a wrong q, ConfigError for a bound "
        "that is negative or NaN.");
}

}  // namespace proxcgal::binding
