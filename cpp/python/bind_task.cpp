#include "bind_fields.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "topics.hpp"

namespace proxcgal::binding {

void bind_task(nb::module_& m) {
  bind_fields<Avoidance, Access::kReadWrite>(m);
  bind_fields<Reach, Access::kReadWrite>(m);
  bind_fields<JointLimits, Access::kReadWrite>(m);
  bind_fields<MinimumAltitude, Access::kReadWrite>(m);
  bind_fields<Manipulability, Access::kReadWrite>(m);
  bind_fields<SelfCollision, Access::kReadWrite>(m);
  m.def("decreasing", &decreasing, "x"_a, "a"_a, "b"_a,
        "Bell of [iCAT]: 1 for x <= a, 0 for x >= b, a cosine between.");
  m.def("increasing", &increasing, "x"_a, "a"_a, "b"_a, "1 - decreasing.");
}

}  // namespace proxcgal::binding
