; What the teacher allows in CookMeal (Han 2024, chapter 5).
(define (domain cook_meal)
  (:requirements :strips :typing)
  (:predicates (on_table ?a) (inside_container ?a ?b) (in_gripper ?a) (is_graspable ?a) (is_container ?a) (is_food ?a)
    (has_water ?a) (has_no_water ?a) (not_in_container ?a) (can_contain_food ?a) (gripper_empty))
  (:action pick_up
    :parameters (?a)
    :precondition (and (gripper_empty) (not_in_container ?a) (is_graspable ?a))
    :effect (and (in_gripper ?a) (not (on_table ?a)) (not (gripper_empty))))
  (:action place_on_table
    :parameters (?a)
    :precondition (and (in_gripper ?a))
    :effect (and (gripper_empty) (on_table ?a) (not (in_gripper ?a))))
  (:action place_first_in_second
    :parameters (?a ?b)
    :precondition (and (in_gripper ?a) (is_container ?b) (is_food ?a) (can_contain_food ?b) (not_in_container ?a))
    :effect (and (inside_container ?a ?b) (gripper_empty) (not (in_gripper ?a)) (not (not_in_container ?a))))
  (:action get_water_from_faucet
    :parameters (?a)
    :precondition (and (in_gripper ?a) (is_container ?a) (not_in_container ?a) (has_no_water ?a))
    :effect (and (has_water ?a) (not (has_no_water ?a))))
  (:action pour_water_from_first_to_second
    :parameters (?a ?b)
    :precondition (and (in_gripper ?a) (has_water ?a) (is_container ?b) (not_in_container ?a) (not_in_container ?b))
    :effect (and (has_water ?b) (has_no_water ?a) (not (has_water ?a)) (not (has_no_water ?b))))
)
