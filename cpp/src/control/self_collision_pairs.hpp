#pragma once
#include <span>
#include <vector>

#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "proxcgal/robot.hpp"

namespace proxcgal::detail {

/// Which pairs of the robot's own links are near one another. Storage is made at set-up.
///
/// Surfaces are searched in turn, as far as the tick's steps reach, and only where the links moved
/// since. In between a pair's nearest points ride on their links, and what the links moved at most
/// tells which pairs cannot have come near.
class SelfCollisionPairs {
 public:
  /// @throws ModelError  a link that does not exist, with the names that do
  SelfCollisionPairs(const Robot& robot, const ControllerConfig& config);

  /// The nearest pairs that come within the task's reach and that joints can part, nearest first.
  /// Distances are those between points of the two surfaces, so never less than the true ones; that
  /// links may be nearer than d_min where the steps were spent before it was known is noted.
  std::span<const LinkPair> nearest(const SelfCollision& spec, const Robot& robot,
                                    const Posture& posture, Monitor& monitor);

 private:
  /// Two links and what is known of them.
  struct Watched {
    int a, b;
    Pose T_AB;                         // when it was searched last
    double within = 0.0;               // [m] and how far
    double at_least = 0.0;             // [m] no nearer than this then
    Vector3 on_a_A = Vector3::Zero();  // nearest points found
    Vector3 on_b_B = Vector3::Zero();
    bool searched = false;
    bool found = false;  // has nearest points
  };

  void search(Watched& pair, const Robot& robot, const Pose& T_AB, double within);

  double min_row_norm_;
  std::vector<Watched> watched_;
  std::size_t next_ = 0;  // whose turn it is
  std::vector<LinkPair> near_;
  PairSearch search_;
};

}  // namespace proxcgal::detail
