#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <tuple>

#include "proxcgal/robot.hpp"
#include "robot_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

template <class Specs>
std::vector<std::string> names_of(const Specs& specs) {
  std::vector<std::string> names;
  for (const auto& spec : specs) names.push_back(spec.name);
  return names;
}

Eigen::MatrixXd jacobian(const Robot& robot, nb::handle q, const nb::object& link,
                         nb::handle point) {
  const int row = link_row(robot, link);
  Jacobian6 out;
  robot.jacobian(posture_at(robot, q), row, vector3_from(point, "point_W"), out);
  return out;
}

}  // namespace

void bind_robot(nb::module_& m) {
  nb::class_<JointSpec>(m, "JointSpec",
                        "One moving joint; fixed joints are folded into `origin`, the joint frame "
                        "at q = 0 in its parent's.")
      .def(
          "__init__",
          [](JointSpec* self, std::string name, const std::string& type, int parent,
             nb::handle origin, nb::handle axis, double q_min, double q_max, double qd_max,
             double qdd_max) {
            new (self) JointSpec{std::move(name),
                                 choice_of<JointType>(type, "type"),
                                 parent,
                                 pose_from(origin, "origin"),
                                 vector3_from(axis, "axis"),
                                 q_min,
                                 q_max,
                                 qd_max,
                                 qdd_max};
          },
          "name"_a, nb::kw_only(), "type"_a = "revolute", "parent"_a = -1, "origin"_a, "axis"_a,
          "q_min"_a = -kInfinity, "q_max"_a = kInfinity, "qd_max"_a = kInfinity,
          "qdd_max"_a = kInfinity,
          "Args: name; type, 'revolute' or 'prismatic'; parent, row of the joint it hangs on, -1 "
          "for the base; origin (4, 4) [m]; axis (3,) unit, in the joint's frame; q_min, q_max "
          "[rad] or [m]; qd_max, qdd_max a second and a second squared.\n"
          "Raises: GeometryError for a wrong shape or no pose, ConfigError for another type.")
      .def_ro("name", &JointSpec::name, "Of the joint.");
  nb::class_<LinkSpec>(m, "LinkSpec",
                       "One rigid link with its mesh in the link frame; `T_JL` is that frame's "
                       "pose in the joint that moves it (-1: the base).")
      .def(
          "__init__",
          [](LinkSpec* self, std::string name, int joint, nb::handle T_JL, nb::handle vertices,
             nb::handle triangles, double mesh_error) {
            const PointsArgument vertices_L(vertices, "vertices_L");
            new (self) LinkSpec{std::move(name),           joint,
                                pose_from(T_JL, "T_JL"),   vertices_L(),
                                triangles_from(triangles), mesh_error};
          },
          "name"_a, "joint"_a, "T_JL"_a, "vertices_L"_a, "triangles"_a, "mesh_error"_a = 0.0,
          "Args: name; joint, row of the one that moves it; T_JL (4, 4) [m]; vertices_L (v, 3) "
          "[m]; triangles (f, 3) vertex rows; mesh_error [m] to the real surface at most.\n"
          "Raises: GeometryError for a wrong shape, no pose, or what is not finite.")
      .def_ro("name", &LinkSpec::name, "Of the link.");
  nb::class_<Robot>(m, "Robot",
                    "Poses and Jacobians of every link, and the links' surfaces. The base stands "
                    "at the world's origin.")
      .def(
          "__init__",
          [](Robot* self, std::string name, std::vector<JointSpec> joints,
             std::vector<LinkSpec> links, std::string tool, int tool_joint, nb::handle T_JT) {
            new (self) Robot(RobotSpec{std::move(name), std::move(joints), std::move(links),
                                       std::move(tool), tool_joint, pose_from(T_JT, "T_JT")});
          },
          "name"_a, "joints"_a, "links"_a, "tool"_a, "tool_joint"_a, "T_JT"_a,
          "Args: name; joints, parents before children; links, base first; tool, the frame's "
          "name; tool_joint, row of the joint that moves it; T_JT (4, 4), its pose in it [m].\n"
          "Raises: ModelError for a tree or limits that are none, GeometryError for a mesh.")
      .def_prop_ro(
          "name", [](const Robot& r) { return r.spec().name; }, "Of the robot.")
      .def_prop_ro("n_q", &Robot::n_q, "Number of moving joints.")
      .def_prop_ro(
          "joint_names", [](const Robot& r) { return names_of(r.spec().joints); },
          "In the order of q.")
      .def_prop_ro(
          "link_names", [](const Robot& r) { return names_of(r.spec().links); },
          "Links that carry a mesh, base first.")
      .def_prop_ro(
          "tool", [](const Robot& r) { return r.spec().tool; }, "Name of the tool frame.")
      .def_prop_ro(
          "q_min", [](const Robot& r) { return Eigen::VectorXd(r.q_min()); }, "(n_q,) [rad or m].")
      .def_prop_ro(
          "q_max", [](const Robot& r) { return Eigen::VectorXd(r.q_max()); }, "(n_q,) [rad or m].")
      .def_prop_ro(
          "qd_max", [](const Robot& r) { return Eigen::VectorXd(r.qd_max()); },
          "(n_q,) [rad/s or m/s].")
      .def_prop_ro(
          "qdd_max", [](const Robot& r) { return Eigen::VectorXd(r.qdd_max()); },
          "(n_q,) [rad/s^2 or m/s^2].")
      .def(
          "link_poses",
          [](const Robot& r, nb::handle q) { return poses_to_numpy(posture_at(r, q).T_WL); }, "q"_a,
          "(n_links, 4, 4) T_WL, in the order of link_names.")
      .def(
          "tool_pose",
          [](const Robot& r, nb::handle q) { return to_matrix(posture_at(r, q).T_WT); }, "q"_a,
          "(4, 4) T_WT.")
      .def("jacobian", &jacobian, "q"_a, "link"_a, "point_W"_a,
           "(6, n_q) at a point (3,) [m] that moves with the link: linear rows first, in world "
           "([WA] eqs. 6 and 7).")
      .def(
          "tool_jacobian",
          [](const Robot& r, nb::handle q) {
            Jacobian6 out;
            r.tool_jacobian(posture_at(r, q), out);
            return Eigen::MatrixXd(out);
          },
          "q"_a, "(6, n_q) at the tool's origin: linear rows first, in world.")
      .def(
          "mesh",
          [](const Robot& r, const nb::object& link) {
            const MeshTree& tree = r.tree(link_row(r, link));
            return std::make_tuple(tree.vertices_L(), tree.triangles());
          },
          "link"_a,
          "The mesh that the controller uses: vertices_L (v, 3) [m] and triangles (f, 3).")
      .def(
          "tree",
          [](const Robot& r, const nb::object& link) -> const MeshTree& {
            return r.tree(link_row(r, link));
          },
          "link"_a, nb::rv_policy::reference_internal,
          "The link's indexed surface, in the link frame.")
      .def(
          "mesh_error",
          [](const Robot& r, const nb::object& link) { return r.mesh_error(link_row(r, link)); },
          "link"_a, "How far the controller's mesh may be from the real surface [m].")
      .def(
          "moves",
          [](const Robot& r, const std::string& joint, const nb::object& link) {
            const auto names = names_of(r.spec().joints);
            const auto at = std::find(names.begin(), names.end(), joint);
            if (at == names.end())
              throw ModelError("robot '" + r.spec().name + "' has no joint '" + joint + "'");
            return r.moves(static_cast<int>(at - names.begin()), link_row(r, link));
          },
          "joint"_a, "link"_a, "Does the joint move the link?");
}

}  // namespace proxcgal::binding
