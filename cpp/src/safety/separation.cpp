#include "proxcgal/safety/separation.hpp"

#include <cmath>
#include <utility>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

/// Rows of the capsules with these names, all of them where none is named.
std::vector<int> rows_of(const std::vector<std::string>& names,
                         const std::vector<LinkCapsule>& capsules, const char* field) {
  std::vector<int> rows;
  std::string known;
  for (std::size_t row = 0; row < capsules.size(); ++row) {
    if (names.empty()) rows.push_back(static_cast<int>(row));
    known += (row > 0 ? ", " : "") + capsules[row].name;
  }
  for (const std::string& name : names) {
    int found = -1;
    for (std::size_t row = 0; row < capsules.size(); ++row)
      if (capsules[row].name == name) found = static_cast<int>(row);
    require(found >= 0, field, "'" + name + "'", "one of " + known);
    rows.push_back(found);
  }
  return rows;
}

bool positive(double value) { return std::isfinite(value) && value > 0.0; }
bool not_negative(double value) { return std::isfinite(value) && value >= 0.0; }

void check(const std::vector<LinkCapsule>& capsules, const Robot& robot) {
  require(!capsules.empty(), "capsules", 0, "1 or more in number");
  for (const LinkCapsule& capsule : capsules) {
    require(capsule.link >= 0 && capsule.link < robot.n_links(), "capsule.link", capsule.link,
            "a row of the robot's links, 0 to " + std::to_string(robot.n_links() - 1));
    require(not_negative(capsule.shape_L.radius), "capsule.radius", capsule.shape_L.radius,
            "0 m or more");
    require(capsule.shape_L.start.allFinite() && capsule.shape_L.end.allFinite(), "capsule",
            "'" + capsule.name + "'", "finite [m]");
  }
}

}  // namespace

void check(const OperatorCapsule& config, const std::string& path) {
  require(config.height >= 2.0 * config.radius, path + "height",
          detail::with_unit(config.height, "m"),
          "at least twice the radius of " + detail::with_unit(config.radius, "m"));
}

void check(const IsoSeparation& iso, const std::string& path) {
  const double sum = iso.intrusion + iso.human_uncertainty + iso.robot_uncertainty;
  require(sum >= 0.0, path + "intrusion + human_uncertainty + robot_uncertainty",
          detail::with_unit(sum, "m"), "at least 0 m");
}

Capsule OperatorCapsule::at(const Pose& T_WT) const {
  const Vector3 middle = T_WT * offset_T;
  const Vector3 half = (0.5 * height - radius) * Vector3::UnitZ();
  return {middle - half, middle + half, radius};
}

double protective_distance(const IsoSeparation& iso, double robot_speed, double stop_time) {
  return iso.human_speed * (iso.reaction_time + stop_time) + robot_speed * iso.reaction_time +
         0.5 * robot_speed * stop_time + iso.intrusion + iso.human_uncertainty +
         iso.robot_uncertainty;
}

Separation::Separation(const Robot& robot, std::vector<LinkCapsule> capsules,
                       SeparationConfig config, double stop_time)
    : capsules_(std::move(capsules)), config_(std::move(config)), stop_time_(stop_time) {
  check(capsules_, robot);
  validate(config_);
  require(positive(stop_time), "stop_time", detail::with_unit(stop_time, "s"), above(0).text("s"));
  pairs_ = rows_of(config_.pairs, capsules_, "separation.pairs");
  ends_ = rows_of(config_.ends, capsules_, "separation.ends");
}

double Separation::distance(int row, const Posture& posture) const {
  const LinkCapsule& own = capsules_[static_cast<std::size_t>(row)];
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(own.link)];
  const Capsule own_W{T_WL * own.shape_L.start, T_WL * own.shape_L.end, own.shape_L.radius};
  return closest(own_W, config_.human.at(posture.T_WT)).distance;
}

const SeparationOutput& Separation::update(const Robot& robot, const Posture& posture,
                                           const JointVector& qd, const Vector3& human_velocity_W) {
  SeparationOutput& out = output_;
  out = SeparationOutput{};
  for (const int row : pairs_) {
    const double distance = this->distance(row, posture);
    // What is no number stays: it must not be passed over for the next one.
    if (distance >= out.distance || std::isnan(out.distance)) continue;
    out.distance = distance;
    out.pair = row;
  }
  // [WT] 2.2: each link's far end, projected on the direction to the operator's axis.
  const Capsule human_W = config_.human.at(posture.T_WT);
  const Vector3 own = config_.subtract_human ? human_velocity_W : Vector3::Zero();
  Jacobian6 J;
  for (const int row : ends_) {
    const LinkCapsule& capsule = capsules_[static_cast<std::size_t>(row)];
    const Vector3 end_W =
        posture.T_WL[static_cast<std::size_t>(capsule.link)] * capsule.shape_L.end;
    robot.jacobian(posture, capsule.link, end_W, J);
    const Vector3 velocity = J.topRows<3>() * qd - own;
    const double speed = approach_speed(end_W, velocity, human_W);
    if (speed <= out.velocity || std::isnan(out.velocity)) continue;
    out.velocity = speed;
    out.end = row;
  }
  // Written so that NaN is never fine.
  out.distance_ok = out.distance >= config_.min_distance;
  out.velocity_ok = out.velocity <= config_.max_velocity;
  out.protective_distance =
      proxcgal::protective_distance(config_.iso, std::max(out.velocity, 0.0), stop_time_);
  return out;
}

}  // namespace proxcgal
