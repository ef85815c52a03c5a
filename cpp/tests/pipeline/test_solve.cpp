#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "allocations.hpp"
#include "meshes.hpp"
#include "proxcgal/error.hpp"
#include "proxcgal/pipeline/solve.hpp"

namespace proxcgal {
namespace {

using test::Random;

Task task(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& rate,
          const Eigen::VectorXd& activation) {
  return {jacobian, rate, activation};
}

Task row(std::initializer_list<double> values, double rate, double activation) {
  Eigen::MatrixXd jacobian(1, static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), jacobian.data());
  return task(jacobian, Eigen::VectorXd::Constant(1, rate),
              Eigen::VectorXd::Constant(1, activation));
}

Task joints(std::initializer_list<double> rates) {
  const auto n = static_cast<Eigen::Index>(rates.size());
  Eigen::VectorXd rate(n);
  std::copy(rates.begin(), rates.end(), rate.data());
  return task(Eigen::MatrixXd::Identity(n, n), rate, Eigen::VectorXd::Ones(n));
}

Solution solved(const std::vector<Task>& tasks, double qd_max = 0.0, SolverConfig config = {}) {
  const auto n = tasks.front().jacobian.cols();
  Solution out;
  const JointVector limit = qd_max > 0.0 ? JointVector::Constant(n, qd_max) : JointVector();
  solve(tasks, static_cast<int>(n), limit, config, out);
  return out;
}

Task random_task(Random& random, int m, int n, double size = 1.0) {
  Task out;
  out.jacobian.resize(m, n);
  out.rate.resize(m);
  out.activation.resize(m);
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < n; ++j) out.jacobian(i, j) = random.uniform(-size, size);
    out.rate[i] = random.uniform(-1.0, 1.0);
    out.activation[i] = std::clamp(random.uniform(-0.5, 1.5), 0.0, 1.0);
  }
  return out;
}

TEST(Solve, GivesTheCheckValuesOfAFadingTask) {
  const double activations[] = {0.0, 0.25, 0.5, 0.75, 1.0};
  const double both[] = {-1.0, -0.44078947, 0.13636364, 0.54532967, 1.0};
  const double alone[] = {0.0, 0.03289474, 0.22727273, 0.55631868, 1.0};
  for (int i = 0; i < 5; ++i) {
    const Task fading = row({1.0, 0.0, 0.0}, 1.0, activations[i]);
    const JointVector qd = solved({fading, joints({-1.0, 0.3, 0.0})}).qd();
    EXPECT_NEAR(qd[0], both[i], 1e-8);
    EXPECT_NEAR(qd[1], 0.3, 1e-8);
    EXPECT_NEAR(solved({fading}).qd()[0], alone[i], 1e-8);
  }
}

TEST(Solve, GivesTheCheckValuesOfABadlyScaledRow) {
  const Task small = row({0.07, 0.0, 0.0}, 0.2, 1.0);
  const Task lower = joints({-1.0, 0.3, 0.0});
  EXPECT_NEAR(solved({small}).qd()[0], 2.79792, 1e-5);
  EXPECT_NEAR(solved({small, lower}).qd()[0], 2.79792, 1e-5);
  const SolverConfig code{.form = Damping::kCode};
  EXPECT_NEAR(solved({small}, 0.0, code).qd()[0], 0.197, 5e-4);
  EXPECT_NEAR(solved({small, lower}, 0.0, code).qd()[0], -0.118, 5e-4);
}

TEST(Solve, TheFirstLevelKeepsItsOptimumAboveAnyOther) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    Task first = random_task(random, 2, 6);
    first.activation.setOnes();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(first.jacobian);
    if (svd.singularValues()[1] < 0.1) continue;
    const Solution out = solved({first, random_task(random, 6, 6), random_task(random, 3, 6)});
    EXPECT_LT(residual(first, out.qd()).norm(), 1e-9);
  }
}

TEST(Solve, EveryLevelStaysWithinTheSpeedLimits) {
  Random random(2);
  for (int i = 0; i < 500; ++i) {
    const Solution out = solved({random_task(random, 1, 7), random_task(random, 6, 7, 0.05),
                                 random_task(random, 7, 7, 10.0)},
                                0.5);
    for (int k = 0; k <= out.levels; ++k) {
      EXPECT_LE(out.rho[static_cast<std::size_t>(k)].cwiseAbs().maxCoeff(), 0.5);
    }
  }
}

TEST(Solve, SaturationKeepsTheDirectionOfATerm) {
  const Task wished = joints({3.0, 1.0, -0.5});
  const JointVector qd = solved({wished}, 1.0).rho[0];
  EXPECT_LT((qd - wished.rate / 3.0).norm(), 1e-12);
}

TEST(Solve, AJointAtItsLimitStopsTheTermThatPushesItOn) {
  // Half active, level 1 leaves half of joint 0's freedom to level 2, which wants more of it.
  const Task upper = row({1.0, 0.0}, 10.0, 0.5);
  const Solution out = solved({upper, joints({50.0, 0.3})}, 1.0);
  EXPECT_EQ(out.rho[0], Eigen::Vector2d(1.0, 0.0));
  EXPECT_EQ(out.qd(), Eigen::Vector2d(1.0, 0.0));
  EXPECT_NEAR(solved({upper, joints({0.5, 0.3})}, 1.0).qd()[1], 0.3, 1e-9);
}

TEST(Solve, RoundingInAJointAtItsLimitStopsNothing) {
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    Task first = random_task(random, 1, 6);
    first.jacobian.row(0).setZero();
    first.jacobian(0, 2) = 1.0;
    first.rate[0] = 10.0;  // joint 2 goes to its limit exactly
    first.activation[0] = 1.0;
    Task second = random_task(random, 2, 6);
    second.jacobian.col(2).setZero();
    second.activation.setOnes();
    second.rate *= 1e-3;
    const JointVector qd = solved({first, second}, 0.5).qd();
    EXPECT_EQ(qd[2], 0.5);
    EXPECT_LT(residual(second, qd).norm(), 1e-6);
  }
}

TEST(Solve, IsFiniteForAnyFiniteInput) {
  Random random(4);
  for (int i = 0; i < 3000; ++i) {
    std::vector<Task> tasks;
    for (int k = 0; k < 3; ++k) {
      Task wild = random_task(random, 1 + (i + k) % 6, 6);
      for (Eigen::Index r = 0; r < wild.rate.size(); ++r) {
        wild.jacobian.row(r) *= std::pow(10.0, random.uniform(-308.0, 308.0));
        wild.rate[r] *= std::pow(10.0, random.uniform(-308.0, 308.0));
        if (random.uniform(0.0, 1.0) < 0.2) wild.jacobian.row(r).setZero();
      }
      tasks.push_back(wild);
    }
    for (const Damping form : {Damping::kLiteral, Damping::kCode}) {
      for (const double qd_max : {0.0, 1.0}) {
        const Solution out = solved(tasks, qd_max, {.damping = i % 2 * 1e-4, .form = form});
        for (int k = 0; k <= out.levels; ++k) {
          ASSERT_TRUE(out.rho[static_cast<std::size_t>(k)].allFinite());
        }
      }
    }
  }
}

TEST(Solve, CountsALevelThatOverflowsAndGoesOnWithoutIt) {
  const Solution out = solved({row({1e200, 0.0}, 1.0, 1.0), joints({0.2, 0.3})});
  EXPECT_EQ(out.overflowed, 1);
  EXPECT_NEAR(out.qd()[0], 0.2, 1e-12);
}

TEST(Solve, WithoutDampingTwoEqualRowsAreOne) {
  const Task twice = task((Eigen::MatrixXd(2, 3) << 1, 2, 3, 1, 2, 3).finished(),
                          Eigen::Vector2d(1.0, 1.0), Eigen::Vector2d(1.0, 1.0));
  const JointVector qd = solved({twice}, 0.0, {.damping = 0.0}).qd();
  EXPECT_LT((qd - Eigen::Vector3d(1, 2, 3) / 14.0).norm(), 1e-12);
}

TEST(Solve, AnEmptyStackStandsStill) {
  Solution out;
  solve({}, 4, JointVector(), {}, out);
  EXPECT_EQ(out.qd(), JointVector::Zero(4));
}

TEST(Solve, AllocatesNothing) {
  Random random(5);
  const std::vector<Task> tasks = {random_task(random, 12, 12), random_task(random, 3, 12),
                                   random_task(random, 32, 12), random_task(random, 6, 12)};
  const JointVector qd_max = JointVector::Constant(12, 1.0);
  Solution out;
  const test::CountAllocations counter;
  for (int i = 0; i < 100; ++i) solve(tasks, 12, qd_max, {}, out);
  EXPECT_EQ(counter.count(), 0U);
}

TEST(SolverConfig, NamesTheFieldItsValueAndItsBound) {
  for (const SolverConfig& bad :
       {SolverConfig{.damping = -1.0}, SolverConfig{.damping_threshold = 0.0},
        SolverConfig{.eta = std::nan("")}}) {
    EXPECT_THROW(validate(bad), ConfigError);
  }
  try {
    validate(SolverConfig{.damping = -1e-9});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_STREQ(error.what(), "SolverConfig.damping is -1e-09, must be finite and at least 0");
  }
}

}  // namespace
}  // namespace proxcgal
