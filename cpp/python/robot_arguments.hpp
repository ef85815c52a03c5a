#pragma once
#include "convert.hpp"
#include "proxcgal/robot.hpp"

/// Arguments that are checked against a robot.
namespace proxcgal::binding {

inline int link_row(const Robot& robot, const nb::object& link) {
  if (nb::isinstance<nb::str>(link)) return robot.link_row(nb::cast<std::string>(link));
  int row = -1;
  if (nb::try_cast(link, row) && row >= 0 && row < robot.n_links()) return row;
  return robot.link_row(text_of(link));  // throws, with the names that exist
}

inline Posture posture_at(const Robot& robot, nb::handle q) {
  Posture posture = robot.make_posture();
  robot.update(vector_from(q, "q", robot.n_q(), Take::kConvert), posture);
  return posture;
}

}  // namespace proxcgal::binding
