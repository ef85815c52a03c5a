#include "fuzz/tick.hpp"

#include <cstdio>
#include <cstdlib>

/// libFuzzer: the tick's inputs.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto run = proxcgal::fuzz::run_ticks(data, size);
  if (!run.violation.empty()) {
    std::fprintf(stderr, "violated: %s\n", run.violation.c_str());
    std::abort();
  }
  return 0;
}
