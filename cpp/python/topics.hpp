#pragma once
#include <nanobind/nanobind.h>

/// One function a topic: each adds its classes and functions to the module.
namespace proxcgal::binding {

void bind_geometry(nanobind::module_& m);
void bind_capsule(nanobind::module_& m);
void bind_robot(nanobind::module_& m);
void bind_sense(nanobind::module_& m);
void bind_pipeline(nanobind::module_& m);
void bind_solve(nanobind::module_& m);
void bind_task(nanobind::module_& m);
void bind_limit(nanobind::module_& m);
void bind_config(nanobind::module_& m);
void bind_output(nanobind::module_& m);
void bind_controller(nanobind::module_& m);
void bind_guard(nanobind::module_& m);
void bind_guiding(nanobind::module_& m);

}  // namespace proxcgal::binding
