; What the teacher allows in SetTable (Han 2024, chapter 5).
(define (domain set_table)
  (:requirements :strips :typing)
  (:predicates (on_table ?a) (on ?a ?b) (in_gripper ?a) (clear_on_top ?a) (is_graspable ?a) (is_thin ?a) (is_plate ?a)
    (gripper_empty))
  (:action pick_up-from_table
    :parameters (?a)
    :precondition (and (gripper_empty) (is_graspable ?a) (clear_on_top ?a) (on_table ?a))
    :effect (and (in_gripper ?a) (not (on_table ?a)) (not (gripper_empty))))
  (:action pick_up-from_object
    :parameters (?a ?b)
    :precondition (and (gripper_empty) (is_graspable ?a) (clear_on_top ?a) (on ?a ?b))
    :effect (and (in_gripper ?a) (clear_on_top ?b) (not (on ?a ?b)) (not (gripper_empty))))
  (:action place_on_table
    :parameters (?a)
    :precondition (and (in_gripper ?a))
    :effect (and (gripper_empty) (on_table ?a) (not (in_gripper ?a))))
  (:action place_first_on_second
    :parameters (?a ?b)
    :precondition (and (in_gripper ?a) (clear_on_top ?b))
    :effect (and (gripper_empty) (on ?a ?b) (not (in_gripper ?a)) (not (clear_on_top ?b))))
  (:action push_plate_on_object
    :parameters (?a ?b)
    :precondition (and (gripper_empty) (is_plate ?a) (is_thin ?b) (clear_on_top ?a) (clear_on_top ?b))
    :effect (and (on ?a ?b) (not (clear_on_top ?b))))
)
