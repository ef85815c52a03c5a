#pragma once
#include <string>
#include <utility>

#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal::binding {

/// A closest pair that tells its link by name.
struct NamedPair {
  ClosestPair pair;
  std::string link;
};

inline NamedPair named(const Robot& robot, const ClosestPair& pair) {
  return {pair, pair.link < 0 ? "" : robot.spec().links[static_cast<std::size_t>(pair.link)].name};
}

}  // namespace proxcgal::binding
