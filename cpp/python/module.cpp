#include <nanobind/nanobind.h>

#include "bind_fields.hpp"
#include "proxcgal/error.hpp"
#include "topics.hpp"

namespace nb = nanobind;

namespace {

/// The Python class of that name in proxcgal.core.errors: they are defined there once.
void raise(const char* name, const char* message) {
  const nb::object type = nb::module_::import_("proxcgal.core.errors").attr(name);
  PyErr_SetString(type.ptr(), message);
}

void translate(const std::exception_ptr& error, void*) {
  try {
    std::rethrow_exception(error);
  } catch (const proxcgal::ConfigError& e) {
    raise("ConfigError", e.what());
  } catch (const proxcgal::ModelError& e) {
    raise("ModelError", e.what());
  } catch (const proxcgal::GeometryError& e) {
    raise("GeometryError", e.what());
  } catch (const proxcgal::ProxError& e) {
    raise("ProxError", e.what());
  }
}

}  // namespace

NB_MODULE(_core, m) {
  m.doc() = "The control loop of proxcgal: geometry, robot, pipeline, solver, tick.";
  nb::register_exception_translator(translate);
  using namespace proxcgal::binding;  // NOLINT(google-build-using-namespace)
  bind_geometry(m);
  bind_capsule(m);
  bind_robot(m);
  bind_sense(m);
  bind_pipeline(m);
  bind_solve(m);
  bind_task(m);
  bind_config(m);
  bind_limit(m);
  bind_output(m);
  bind_controller(m);
  bind_guard(m);
  bind_guiding(m);
  bind_field_tables(m);
}
