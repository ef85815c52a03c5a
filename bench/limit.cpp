/// Limit stage: limit/joints=12/retreats=16/caps=24/nominal=blocked, thread CPU a call.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "pipeline/limit_inputs.hpp"

namespace {

double cpu_us() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

double quantile(std::vector<double>& values, double p) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1))];
}

}  // namespace

int main(int argc, char** argv) {
  using namespace proxcgal;
  const int calls = argc > 1 ? std::atoi(argv[1]) : 20000;
  std::printf("%-72s %8s %8s %8s  programmes unchanged\n", "thread CPU [us]", "median", "p99",
              "max");
  for (const auto shape : {test::Shape::kOrdinary, test::Shape::kPinched})
    for (const Eigen::Index n : {6, 12})
      for (const int retreats : {0, 4, 16})
        for (const int caps : {8, 24}) {
          test::Random random(1);
          std::vector<double> us;
          double programmes = 0.0, unchanged = 0.0;
          for (int i = 0; i < calls; ++i) {
            const test::LimitCase one = test::random_case(random, n, shape, caps, retreats);
            Limiter limiter(one.limits, {}, 0.01);
            one.through(limiter);  // caches
            const double begun = cpu_us();
            const LimitOutput& out = one.through(limiter);
            us.push_back(cpu_us() - begun);
            programmes += out.programmes;
            unchanged += out.status == LimitStatus::kUnchanged ? 1.0 : 0.0;
          }
          char name[128];
          std::snprintf(name, sizeof name, "limit/joints=%d/retreats=%d/caps=%d/%s",
                        static_cast<int>(n), retreats, caps,
                        shape == test::Shape::kPinched ? "pinched" : "random");
          std::printf("%-72s %8.1f %8.1f %8.1f  %.2f %.2f\n", name, quantile(us, 0.5),
                      quantile(us, 0.99), quantile(us, 1.0), programmes / calls, unchanged / calls);
        }
  return 0;
}
