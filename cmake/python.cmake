# The extension proxcgal._core, with its generated types.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
find_package(nanobind CONFIG REQUIRED)

file(GLOB_RECURSE proxcgal_binding_sources CONFIGURE_DEPENDS cpp/python/*.cpp)
nanobind_add_module(_core NB_STATIC NB_SUPPRESS_WARNINGS NOMINSIZE ${proxcgal_binding_sources})
target_link_libraries(_core PRIVATE proxcgal::core proxcgal_flags)

# The stub generator imports the module as it will be installed: inside a package. Of the package
# only the exceptions are there, which the module looks up.
set(proxcgal_stage ${CMAKE_CURRENT_BINARY_DIR}/stage/proxcgal)
set_target_properties(_core PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${proxcgal_stage})
file(WRITE ${proxcgal_stage}/__init__.py "")
if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/src/proxcgal/errors.py)
  configure_file(src/proxcgal/errors.py ${proxcgal_stage}/errors.py COPYONLY)
endif()
nanobind_add_stub(
  _core_stub
  MODULE proxcgal._core
  OUTPUT ${proxcgal_stage}/_core.pyi
  MARKER_FILE ${proxcgal_stage}/py.typed
  PYTHON_PATH ${CMAKE_CURRENT_BINARY_DIR}/stage
  DEPENDS _core)

install(TARGETS _core LIBRARY DESTINATION proxcgal)
install(FILES ${proxcgal_stage}/_core.pyi ${proxcgal_stage}/py.typed DESTINATION proxcgal)
