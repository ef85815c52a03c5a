#pragma once
#include <cstddef>

namespace proxcgal::test {

/// Counts every heap allocation of this thread while it lives, whoever makes it.
class CountAllocations {
 public:
  CountAllocations();
  ~CountAllocations();
  std::size_t count() const;
};

}  // namespace proxcgal::test
