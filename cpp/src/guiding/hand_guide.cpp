#include "proxcgal/guiding/hand_guide.hpp"

#include <string>
#include <utility>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

constexpr double kHeldBack =
    1e-9;  ///< [m/s], [rad/s] a smaller difference is the solver's rounding

void require_joints(const JointVector& values, Eigen::Index n, const char* field) {
  require(values.size() == 0 || values.size() == n, field, values.transpose(),
          std::to_string(n) + " numbers above 0, one a joint");
}

HandGuideConfig checked(HandGuideConfig config, const Robot& robot) {
  validate(config);
  require_joints(config.qd_max, robot.n_q(), "qd_max");
  require_joints(config.qdd_max, robot.n_q(), "qdd_max");
  return config;
}

}  // namespace

HandGuide::HandGuide(std::shared_ptr<const Robot> robot, HandGuideConfig config)
    : robot_(std::move(robot)),
      config_(checked(std::move(config), *robot_)),
      admittance_(config_.admittance),
      qd_max_(config_.qd_max.size() > 0 ? config_.qd_max : robot_->qd_max()),
      limiter_({robot_->q_min(), robot_->q_max(), qd_max_,
                config_.qdd_max.size() > 0 ? config_.qdd_max : robot_->qdd_max()},
               LimitConfig::papers(), config_.period),
      posture_(robot_->make_posture()) {
  task_.activation.setOnes(6);
  output_.qd.setZero(robot_->n_q());
}

const HandGuideOutput& HandGuide::step(const JointVector& q, const Vector6& force, bool engaged) {
  robot_->update(q, posture_);
  Jacobian6 J;
  robot_->tool_jacobian(posture_, J);
  output_.T_WT = posture_.T_WT;
  output_.wanted = admittance_.step(force, engaged, config_.period);
  task_.jacobian = J;
  task_.rate = output_.wanted;
  solve({&task_, 1}, robot_->n_q(), qd_max_, config_.solver, solution_);
  limiter_.begin(q, output_.qd, config_.period);
  output_.qd = limiter_.limit({.nominal = solution_.qd(), .tasks = {&task_, 1}}).qd;
  output_.achieved = J * output_.qd;
  if ((output_.achieved - output_.wanted).cwiseAbs().maxCoeff() > kHeldBack)
    admittance_.held_to(output_.achieved);
  return output_;
}

void HandGuide::halt() {
  admittance_.stop();
  output_.qd.setZero();
  output_.wanted.setZero();
  output_.achieved.setZero();
}

}  // namespace proxcgal
