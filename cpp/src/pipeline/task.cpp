#include "proxcgal/pipeline/task.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

/// A task of m rows on n joints, all zero.
Task& cleared(BuiltTask& out, Eigen::Index m, Eigen::Index n) {
  out.smallest_row_norm = kInfinity;
  out.task.jacobian.setZero(m, n);
  out.task.rate.setZero(m);
  out.task.activation.setZero(m);
  return out.task;
}

/// Scales a scalar row to unit norm, its rate alike.
void scale(BuiltTask& out, Eigen::Index row) {
  const double norm = out.task.jacobian.row(row).norm();
  out.smallest_row_norm = std::min(out.smallest_row_norm, norm);
  if (norm < kSmallRowNorm) return;
  out.task.jacobian.row(row) /= norm;
  out.task.rate[row] /= norm;
}

/// At most `bound` long, direction kept.
Vector3 saturated(const Vector3& v, double bound) {
  const double length = v.norm();
  return length > bound ? Vector3(v * (bound / length)) : v;
}

/// d mu / d J of mu = sqrt(det(J J')), and mu. By singular values, because the usual
/// mu J^+ is 0 / 0 at a singular posture: each one's slope is the product of all the others.
Jacobian6 slope(const Jacobian6& J, double& mu) {
  const Eigen::JacobiSVD<Jacobian6> svd(J, Eigen::ComputeThinU | Eigen::ComputeThinV);
  Jacobian6 by_J = Jacobian6::Zero(6, J.cols());
  mu = 1.0;
  for (int k = 0; k < 6; ++k) {
    double others = 1.0;
    for (int i = 0; i < 6; ++i) others *= i == k ? 1.0 : svd.singularValues()[i];
    by_J += others * svd.matrixU().col(k) * svd.matrixV().col(k).transpose();
    mu *= svd.singularValues()[k];
  }
  return by_J;
}

/// How column j of the tool's Jacobian changes with joint i, both on the tool's chain: an earlier
/// joint turns the column, a later one moves the point that it is for.
Eigen::Matrix<double, 6, 1> column_derivative(const Jacobian6& J, Eigen::Index j, Eigen::Index i) {
  const Vector3 turn_i = J.col(i).tail<3>();
  const Vector3 turn_j = J.col(j).tail<3>();
  Eigen::Matrix<double, 6, 1> out;
  if (i <= j) {
    out << turn_i.cross(J.col(j).head<3>()), turn_i.cross(turn_j);
  } else {
    out << turn_j.cross(J.col(i).head<3>()), Vector3::Zero();
  }
  return out;
}

/// Joints of the arm whose manipulability is meant.
Eigen::Index arm_size(const Manipulability& spec, Eigen::Index n) {
  return spec.joints > 0 ? spec.joints : n - spec.first_joint;
}

}  // namespace

Vector3 normal_W(const ControlPair& pair) {
  constexpr double coincident = 1e-12;  // [m] no direction is left in the rounding
  const Vector3 apart = pair.control_W - pair.obstacle_W;
  const double length = apart.norm();
  if (!(length > coincident)) return pair.fallback_normal_W;
  return apart * ((pair.distance < 0.0 ? -1.0 : 1.0) / length);
}

JointVector opening_row(const Robot& robot, const Posture& posture, const ControlPair& pair) {
  Jacobian6 J;
  robot.jacobian(posture, pair.link, pair.control_W, J);
  return J.topRows<3>().transpose() * normal_W(pair);
}

JointVector parting_row(const Robot& robot, const Posture& posture, const LinkPair& pair) {
  const Vector3 apart = pair.on_a_W - pair.on_b_W;
  const bool crossing = !(apart.norm() > 1e-9);  // [m] no direction is left in the rounding
  const Vector3 n_W = crossing ? pair.fallback_normal_W : Vector3(apart.normalized());
  Jacobian6 J_a, J_b;
  robot.jacobian(posture, pair.a, pair.on_a_W, J_a);
  robot.jacobian(posture, pair.b, pair.on_b_W, J_b);
  return (J_a - J_b).topRows<3>().transpose() * n_W;
}

double decreasing(double x, double a, double b) {
  if (x <= a) return 1.0;
  if (x >= b) return 0.0;
  return 0.5 * std::cos(std::numbers::pi * (x - a) / (b - a)) + 0.5;
}

double increasing(double x, double a, double b) { return 1.0 - decreasing(x, a, b); }

void validate(const TaskSpec& spec, const Robot& robot) {
  validate(spec);
  if (const auto* own = std::get_if<SelfCollision>(&spec)) {
    for (const auto& [a, b] : own->pairs) {
      if (robot.link_row(a) == robot.link_row(b)) {
        throw ConfigError("SelfCollision.pairs names '" + a + "' beside itself");
      }
    }
  }
  const auto* manipulability = std::get_if<Manipulability>(&spec);
  if (manipulability == nullptr) return;
  const int joints = static_cast<int>(arm_size(*manipulability, robot.n_q()));
  require(joints >= 6 && manipulability->first_joint + joints <= robot.n_q(),
          "Manipulability.joints", joints,
          "at least 6, within the robot's " + std::to_string(robot.n_q()) +
              " from first_joint = " + std::to_string(manipulability->first_joint));
}

void build_avoidance(const Avoidance& spec, const Robot& robot, const Posture& posture,
                     std::span<const ControlPair> pairs, BuiltTask& out) {
  const auto m = std::min<Eigen::Index>(static_cast<Eigen::Index>(pairs.size()), kMaxRows);
  Task& task = cleared(out, m, robot.n_q());
  for (Eigen::Index i = 0; i < m; ++i) {
    const ControlPair& pair = pairs[static_cast<std::size_t>(i)];
    const double inactive_from = spec.d_min + spec.buffer;
    // Equation (6) with (7): the point's linear Jacobian along the normal.
    task.jacobian.row(i) = opening_row(robot, posture, pair).transpose();
    // Equation (4): lambda (d_min + Delta - d), plus the obstacle's own approach.
    task.rate[i] =
        normal_W(pair).dot(pair.obstacle_velocity_W) + spec.gain * (inactive_from - pair.distance);
    // Equation (5).
    task.activation[i] = decreasing(pair.distance, spec.d_min, inactive_from);
    scale(out, i);
  }
}

void build_reach(const Reach& spec, const Robot& robot, const Posture& posture, const Pose& goal_WT,
                 BuiltTask& out) {
  const bool position = spec.rows != ReachRows::kOrientation;
  const bool orientation = spec.rows != ReachRows::kPosition;
  Task& task = cleared(out, position && orientation ? 6 : 3, robot.n_q());
  Jacobian6 J;
  robot.tool_jacobian(posture, J);
  if (position) task.jacobian.topRows<3>() = J.topRows<3>();
  if (orientation) task.jacobian.bottomRows<3>() = J.bottomRows<3>();
  // Equations (8) and (9).
  const Vector3 ahead_W = goal_WT.translation() - posture.T_WT.translation();
  const Vector3 turn_W = rotation_error(posture.T_WT.linear(), goal_WT.linear());
  if (position) task.rate.head<3>() = saturated(spec.gain * ahead_W, spec.max_linear);
  if (orientation) task.rate.tail<3>() = saturated(spec.gain * turn_W, spec.max_angular);
  task.activation.setOnes();
}

void build_joint_limits(const JointLimits& spec, const Robot& robot, const Posture& posture,
                        BuiltTask& out) {
  const int n = robot.n_q();
  Task& task = cleared(out, n, n);
  task.jacobian.setIdentity();
  for (int j = 0; j < n; ++j) {
    const double q = posture.q[j];
    const double low = robot.q_min()[j];
    const double high = robot.q_max()[j];
    if (std::isfinite(low) && std::isfinite(high)) {
      task.rate[j] = spec.gain * (0.5 * (low + high) - q);
    } else if (std::isfinite(high)) {
      task.rate[j] = spec.gain * (high - spec.margin - q);
    } else if (std::isfinite(low)) {
      task.rate[j] = spec.gain * (low + spec.margin - q);
    }
    const double near_high = std::isfinite(high) ? increasing(q, high - spec.margin, high) : 0.0;
    const double near_low = std::isfinite(low) ? decreasing(q, low, low + spec.margin) : 0.0;
    task.activation[j] = std::max(near_high, near_low);
  }
}

void build_minimum_altitude(const MinimumAltitude& spec, const Robot& robot, const Posture& posture,
                            BuiltTask& out) {
  Task& task = cleared(out, 1, robot.n_q());
  Jacobian6 J;
  robot.tool_jacobian(posture, J);
  const double z = posture.T_WT.translation().z();
  task.jacobian.row(0) = J.row(2);
  task.rate[0] = spec.gain * (spec.height + spec.buffer - z);
  task.activation[0] = decreasing(z, spec.height, spec.height + spec.buffer);
  scale(out, 0);
}

void build_manipulability(const Manipulability& spec, const Robot& robot, const Posture& posture,
                          BuiltTask& out) {
  const Eigen::Index n = robot.n_q();
  const Eigen::Index first = spec.first_joint;
  const Eigen::Index size = arm_size(spec, n);
  Task& task = cleared(out, 1, n);
  double mu = 0.0;
  if (size >= 6 && first + size <= n) {  // with fewer joints J J' is singular everywhere
    Jacobian6 J;
    robot.tool_jacobian(posture, J);
    const Jacobian6 by_J = slope(J.middleCols(first, size), mu);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < size; ++j) {
        task.jacobian(0, i) += by_J.col(j).dot(column_derivative(J, first + j, i));
      }
    }
  }
  mu /= spec.unit;
  task.jacobian /= spec.unit;
  task.rate[0] = spec.gain * (spec.target - mu);
  task.activation[0] = decreasing(mu, spec.low, spec.high);
  scale(out, 0);
}

void build_self_collision(const SelfCollision& spec, const Robot& robot, const Posture& posture,
                          std::span<const LinkPair> pairs, BuiltTask& out) {
  const auto m = std::min<Eigen::Index>(static_cast<Eigen::Index>(pairs.size()), kMaxRows);
  Task& task = cleared(out, m, robot.n_q());
  const double inactive_from = spec.d_min + spec.buffer;
  for (Eigen::Index i = 0; i < m; ++i) {
    const LinkPair& pair = pairs[static_cast<std::size_t>(i)];
    task.jacobian.row(i) = parting_row(robot, posture, pair).transpose();
    task.rate[i] = spec.gain * (inactive_from - pair.distance);
    task.activation[i] = decreasing(pair.distance, spec.d_min, inactive_from);
    scale(out, i);
  }
}

double row_norm(const Robot& robot, const Posture& posture, const ControlPair& pair) {
  return opening_row(robot, posture, pair).norm();
}

Vector3 rotation_error(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  Eigen::Quaterniond turn(Eigen::Matrix3d(to * from.transpose()));
  turn.normalize();
  if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();  // the short way round
  const double half_sine = turn.vec().norm();
  // n theta = vec theta / sin(theta / 2), which is 2 vec where both vanish.
  if (half_sine < 1e-9) return 2.0 * turn.vec();
  return turn.vec() * (2.0 * std::atan2(half_sine, turn.w()) / half_sine);
}

}  // namespace proxcgal
