#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "proxcgal/error.hpp"
#include "robots.hpp"

namespace proxcgal {
namespace {

TEST(Robot, NamesWhatCannotBePartOfOne) {
  const RobotSpec good = test::arm()->spec();
  const double nan = std::nan("");
  const auto refusal = [&](const std::function<void(RobotSpec&)>& change) -> std::string {
    RobotSpec spec = good;
    change(spec);
    try {
      const Robot robot(std::move(spec));
      return "";
    } catch (const ModelError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(refusal([](RobotSpec&) {}), "");
  EXPECT_EQ(refusal([&](RobotSpec& s) { s.joints[2].origin.translation().x() = nan; }),
            "robot 'arm', joint 'joint3': its origin is not finite");
  EXPECT_EQ(refusal([&](RobotSpec& s) { s.links[3].T_JL.translation().y() = nan; }),
            "robot 'arm', link 'link3': its pose is not finite");
  EXPECT_EQ(refusal([&](RobotSpec& s) { s.T_JT.linear()(0, 0) = nan; }),
            "robot 'arm', tool 'tool': its pose is not finite");
  EXPECT_EQ(refusal([](RobotSpec& s) { s.links[1].mesh_error = kInfinity; }),
            "robot 'arm', link 'link1': its mesh error must be finite and 0 m or more");
  EXPECT_EQ(refusal([](RobotSpec& s) { s.joints[1].parent = 3; }),
            "robot 'arm', joint 'joint2': its parent must come before it");
}

}  // namespace
}  // namespace proxcgal
