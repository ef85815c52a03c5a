#pragma once
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "proxcgal/fields.hpp"
#include "proxcgal/geometry/mesh_tree.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

enum class JointType : std::uint8_t { kRevolute, kPrismatic };
template <>
inline constexpr auto choices<JointType> = std::array{Choice{"revolute", JointType::kRevolute},
                                                      Choice{"prismatic", JointType::kPrismatic}};

/// One moving joint. Fixed joints are folded into `origin` by whoever reads the description.
struct JointSpec {
  std::string name;
  JointType type = JointType::kRevolute;
  int parent = -1;                  ///< row of the joint it hangs on, -1 for the base
  Pose origin = Pose::Identity();   ///< joint frame at q = 0 in the parent joint's frame
  Vector3 axis = Vector3::UnitZ();  ///< in the joint frame, unit
  double q_min = -kInfinity;        ///< [rad] or [m]
  double q_max = kInfinity;         ///< [rad] or [m]
  double qd_max = kInfinity;        ///< [rad/s] or [m/s]
  double qdd_max = kInfinity;       ///< [rad/s^2] or [m/s^2]
};

/// One rigid link that carries a mesh.
struct LinkSpec {
  std::string name;
  int joint = -1;                ///< the joint that moves it, -1 for the base
  Pose T_JL = Pose::Identity();  ///< link frame in that joint's frame
  Points vertices_L;             ///< [m]
  Triangles triangles;
  double mesh_error = 0.0;  ///< [m] how far this mesh may be from the real surface
};

struct RobotSpec {
  std::string name;
  std::vector<JointSpec> joints;  ///< parents before children
  std::vector<LinkSpec> links;    ///< base first
  std::string tool = "tool";
  int tool_joint = -1;
  Pose T_JT = Pose::Identity();
};

/// Where every joint and link is at one posture. Reused from tick to tick.
struct Posture {
  JointVector q;
  std::vector<Pose> T_WJ;       ///< per joint, after its motion
  std::vector<Pose> T_WL;       ///< per link
  std::vector<Vector3> axis_W;  ///< per joint
  Pose T_WT = Pose::Identity();
};

/// Poses and Jacobians of every link, and the links' surfaces. Immutable once built.
///
/// A tree of revolute and prismatic joints on Orocos KDL segments; the base stands at the world's
/// origin. Every query writes into storage of the caller's, so the tick allocates nothing.
class Robot {
 public:
  /// @throws ModelError     no joint, too many, a parent after its child, limits that cross
  /// @throws GeometryError  a link's mesh, with the link's name
  explicit Robot(RobotSpec spec);
  ~Robot();
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  const RobotSpec& spec() const;
  int n_q() const;
  int n_links() const;
  const MeshTree& tree(int link) const;
  double mesh_error(int link) const;
  /// @throws ModelError  with the names that exist
  int link_row(const std::string& name) const;
  /// Does joint j move link l?
  bool moves(int joint, int link) const;

  const JointVector& q_min() const;
  const JointVector& q_max() const;
  const JointVector& qd_max() const;
  const JointVector& qdd_max() const;

  /// A posture with storage for this robot, at q = 0.
  Posture make_posture() const;
  /// Forward kinematics. @param q finite, (n_q,)
  void update(const JointVector& q, Posture& posture) const;
  /// Linear rows first, expressed in world, at a point that moves with `link`.
  void jacobian(const Posture& posture, int link, const Vector3& point_W, Jacobian6& out) const;
  /// The same at the tool's origin.
  void tool_jacobian(const Posture& posture, Jacobian6& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
