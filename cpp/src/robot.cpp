#include "proxcgal/robot.hpp"

#include <algorithm>
#include <cmath>
#include <future>
#include <kdl/segment.hpp>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

KDL::Frame to_kdl(const Pose& T) {
  KDL::Frame frame;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) frame.M(i, j) = T.linear()(i, j);
    frame.p(i) = T.translation()(i);
  }
  return frame;
}

Pose from_kdl(const KDL::Frame& frame) {
  Pose T = Pose::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T.linear()(i, j) = frame.M(i, j);
    T.translation()(i) = frame.p(i);
  }
  return T;
}

KDL::Segment segment_of(const JointSpec& joint) {
  // KDL's joint may have an axis of its own: origin and axis are given in the parent's frame.
  const KDL::Frame origin = to_kdl(joint.origin);
  const KDL::Vector axis = origin.M * KDL::Vector(joint.axis.x(), joint.axis.y(), joint.axis.z());
  const auto type =
      joint.type == JointType::kRevolute ? KDL::Joint::RotAxis : KDL::Joint::TransAxis;
  return KDL::Segment(joint.name, KDL::Joint(joint.name, origin.p, axis, type), origin);
}

void check(const RobotSpec& spec) {
  const int n = static_cast<int>(spec.joints.size());
  if (n == 0) throw ModelError("robot '" + spec.name + "' has no moving joint");
  if (n > kMaxJoints) {
    throw ModelError("robot '" + spec.name + "' has " + std::to_string(n) +
                     " moving joints: at most " + std::to_string(kMaxJoints) + " are supported");
  }
  const auto bad = [&](const std::string& what, const std::string& why) {
    throw ModelError("robot '" + spec.name + "', " + what + ": " + why);
  };
  for (int j = 0; j < n; ++j) {
    const JointSpec& joint = spec.joints[static_cast<std::size_t>(j)];
    const std::string what = "joint '" + joint.name + "'";
    if (joint.parent < -1 || joint.parent >= j) bad(what, "its parent must come before it");
    if (!joint.origin.matrix().allFinite()) bad(what, "its origin is not finite");
    if (!(std::abs(joint.axis.norm() - 1.0) < 1e-6)) bad(what, "its axis must have unit length");
    if (!(joint.q_min < joint.q_max)) bad(what, "its lower limit must be below its upper one");
    if (!(joint.qd_max > 0.0)) bad(what, "its speed limit must be positive");
    if (!(joint.qdd_max > 0.0)) bad(what, "its acceleration limit must be positive");
  }
  if (spec.links.empty()) throw ModelError("robot '" + spec.name + "' has no link with a mesh");
  for (const LinkSpec& link : spec.links) {
    const std::string what = "link '" + link.name + "'";
    if (link.joint < -1 || link.joint >= n) bad(what, "its joint does not exist");
    if (!link.T_JL.matrix().allFinite()) bad(what, "its pose is not finite");
    if (!(link.mesh_error >= 0.0 && std::isfinite(link.mesh_error)))
      bad(what, "its mesh error must be finite and 0 m or more");
  }
  if (spec.tool_joint < -1 || spec.tool_joint >= n)
    bad("tool '" + spec.tool + "'", "its joint does not exist");
  if (!spec.T_JT.matrix().allFinite()) bad("tool '" + spec.tool + "'", "its pose is not finite");
}

/// The links' trees, built side by side.
std::vector<MeshTree> trees_of(const RobotSpec& spec) {
  std::vector<std::future<MeshTree>> building;
  for (const LinkSpec& link : spec.links) {
    // Deferred where no thread can be had.
    building.push_back(std::async(std::launch::async | std::launch::deferred,
                                  [&link] { return MeshTree(link.vertices_L, link.triangles); }));
  }
  std::vector<MeshTree> trees;
  for (std::size_t i = 0; i < building.size(); ++i) {
    try {
      trees.push_back(building[i].get());
    } catch (const GeometryError& error) {
      throw GeometryError("robot '" + spec.name + "', link '" + spec.links[i].name +
                          "': " + error.what());
    }
  }
  return trees;
}

}  // namespace

struct Robot::Impl {
  RobotSpec spec;
  std::vector<KDL::Segment> segments;
  std::vector<MeshTree> trees;
  std::vector<std::vector<int>> chain_of_link;  // joints that move it, base first
  std::vector<int> chain_of_tool;
  JointVector q_min, q_max, qd_max, qdd_max;

  std::vector<int> chain(int joint) const {
    std::vector<int> joints;
    for (int j = joint; j >= 0; j = spec.joints[static_cast<std::size_t>(j)].parent)
      joints.push_back(j);
    std::reverse(joints.begin(), joints.end());
    return joints;
  }

  void jacobian(const Posture& posture, const std::vector<int>& joints, const Vector3& point_W,
                Jacobian6& out) const {
    out.setZero(6, static_cast<Eigen::Index>(spec.joints.size()));
    for (const int j : joints) {
      const auto row = static_cast<std::size_t>(j);
      const Vector3& axis = posture.axis_W[row];
      if (spec.joints[row].type == JointType::kPrismatic) {
        out.col(j).head<3>() = axis;
      } else {
        // The velocity of a point that turns about the axis: [WA] eqs. (6) and (7).
        out.col(j).head<3>() = axis.cross(point_W - posture.T_WJ[row].translation());
        out.col(j).tail<3>() = axis;
      }
    }
  }
};

Robot::Robot(RobotSpec spec) : impl_(std::make_unique<Impl>()) {
  check(spec);
  Impl& me = *impl_;
  me.spec = std::move(spec);
  const auto n = static_cast<Eigen::Index>(me.spec.joints.size());
  for (JointVector* limit : {&me.q_min, &me.q_max, &me.qd_max, &me.qdd_max}) limit->resize(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    JointSpec& joint = me.spec.joints[static_cast<std::size_t>(j)];
    joint.axis.normalize();
    me.segments.push_back(segment_of(joint));
    me.q_min[j] = joint.q_min;
    me.q_max[j] = joint.q_max;
    me.qd_max[j] = joint.qd_max;
    me.qdd_max[j] = joint.qdd_max;
  }
  me.trees = trees_of(me.spec);
  for (const LinkSpec& link : me.spec.links) me.chain_of_link.push_back(me.chain(link.joint));
  me.chain_of_tool = me.chain(me.spec.tool_joint);
}
Robot::~Robot() = default;

const RobotSpec& Robot::spec() const { return impl_->spec; }
int Robot::n_q() const { return static_cast<int>(impl_->spec.joints.size()); }
int Robot::n_links() const { return static_cast<int>(impl_->spec.links.size()); }
const MeshTree& Robot::tree(int link) const { return impl_->trees[static_cast<std::size_t>(link)]; }
double Robot::mesh_error(int link) const {
  return impl_->spec.links[static_cast<std::size_t>(link)].mesh_error;
}
const JointVector& Robot::q_min() const { return impl_->q_min; }
const JointVector& Robot::q_max() const { return impl_->q_max; }
const JointVector& Robot::qd_max() const { return impl_->qd_max; }
const JointVector& Robot::qdd_max() const { return impl_->qdd_max; }

int Robot::link_row(const std::string& name) const {
  std::string names;
  for (int l = 0; l < n_links(); ++l) {
    const std::string& known = impl_->spec.links[static_cast<std::size_t>(l)].name;
    if (known == name) return l;
    names += (l > 0 ? ", " : "") + known;
  }
  throw ModelError("robot '" + impl_->spec.name + "' has no link '" + name +
                   "' with a mesh: it has " + names);
}

bool Robot::moves(int joint, int link) const {
  const auto& chain = impl_->chain_of_link[static_cast<std::size_t>(link)];
  return std::find(chain.begin(), chain.end(), joint) != chain.end();
}

Posture Robot::make_posture() const {
  Posture posture;
  posture.T_WJ.resize(impl_->spec.joints.size(), Pose::Identity());
  posture.axis_W.resize(impl_->spec.joints.size(), Vector3::UnitZ());
  posture.T_WL.resize(impl_->spec.links.size(), Pose::Identity());
  update(JointVector::Zero(n_q()), posture);
  return posture;
}

void Robot::update(const JointVector& q, Posture& posture) const {
  posture.q = q;
  const RobotSpec& spec = impl_->spec;
  const auto after = [&](int joint) {
    return joint < 0 ? Pose::Identity() : posture.T_WJ[static_cast<std::size_t>(joint)];
  };
  for (std::size_t j = 0; j < spec.joints.size(); ++j) {
    const JointSpec& joint = spec.joints[j];
    posture.T_WJ[j] =
        after(joint.parent) * from_kdl(impl_->segments[j].pose(q[static_cast<Eigen::Index>(j)]));
    posture.axis_W[j] = posture.T_WJ[j].linear() * joint.axis;
  }
  for (std::size_t l = 0; l < spec.links.size(); ++l) {
    posture.T_WL[l] = after(spec.links[l].joint) * spec.links[l].T_JL;
  }
  posture.T_WT = after(spec.tool_joint) * spec.T_JT;
}

void Robot::jacobian(const Posture& posture, int link, const Vector3& point_W,
                     Jacobian6& out) const {
  impl_->jacobian(posture, impl_->chain_of_link[static_cast<std::size_t>(link)], point_W, out);
}

void Robot::tool_jacobian(const Posture& posture, Jacobian6& out) const {
  impl_->jacobian(posture, impl_->chain_of_tool, posture.T_WT.translation(), out);
}

}  // namespace proxcgal
