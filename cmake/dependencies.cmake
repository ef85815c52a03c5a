# Third-party libraries, all from the system. Their headers are SYSTEM: warnings are for our code.

# CONFIG, because CGAL ships a FindEigen3 that hides the target.
find_package(Eigen3 3.4 REQUIRED CONFIG)

# Header only, and not by find_package(CGAL): that would link GMP and MPFR, which the kernel used
# here does not need, and add -frounding-math to every file.
find_path(CGAL_INCLUDE_DIR CGAL/version.h REQUIRED)
add_library(proxcgal_cgal INTERFACE)
target_include_directories(proxcgal_cgal SYSTEM INTERFACE ${CGAL_INCLUDE_DIR})

find_package(orocos_kdl REQUIRED)
add_library(proxcgal_kdl INTERFACE)
target_include_directories(proxcgal_kdl SYSTEM INTERFACE ${orocos_kdl_INCLUDE_DIRS})
target_link_libraries(proxcgal_kdl INTERFACE ${orocos_kdl_LIBRARIES})

# Header only. From PyPI it lies in the prefix that cmeel packages share, inside site-packages:
# scikit-build-core puts those on CMAKE_PREFIX_PATH, also in an isolated build. A plain CMake build
# finds it in .venv, in the active environment, or by CMAKE_PREFIX_PATH.
file(GLOB proxcgal_cmeel_prefixes "${CMAKE_CURRENT_SOURCE_DIR}/.venv/lib/python3*/site-packages"
     "$ENV{VIRTUAL_ENV}/lib/python3*/site-packages")
string(REPLACE ":" ";" proxcgal_environment_prefixes "$ENV{CMAKE_PREFIX_PATH}")
list(PREPEND proxcgal_cmeel_prefixes ${CMAKE_PREFIX_PATH} ${proxcgal_environment_prefixes})
list(TRANSFORM proxcgal_cmeel_prefixes APPEND /cmeel.prefix/include)
find_path(EIQUADPROG_INCLUDE_DIR eiquadprog/eiquadprog-rt.hpp HINTS ${proxcgal_cmeel_prefixes}
          REQUIRED)
# For the one file that needs it: that prefix may hold a Boost too, which CGAL must not take.
set_source_files_properties(cpp/src/pipeline/limit_least_distance.cpp
                            PROPERTIES COMPILE_OPTIONS "-isystem;${EIQUADPROG_INCLUDE_DIR}")
