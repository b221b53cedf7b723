; What the teacher of a room allows.
(define (domain room)
  (:requirements :strips)
  (:predicates (hand_empty) (holding ?a) (on ?a ?b) (inside ?a ?b) (stacked ?a) (clear ?a) (open ?a) (closed ?a)
    (has_door ?a) (reachable ?a) (graspable ?a) (level ?a) (accessible ?a))
  (:action pick-from
    :parameters (?a ?x)
    :precondition (and (hand_empty) (graspable ?a) (clear ?a) (reachable ?a) (accessible ?a) (on ?a ?x))
    :effect (and (holding ?a) (clear ?x) (not (hand_empty)) (not (on ?a ?x)) (not (stacked ?a))))
  (:action pick-out
    :parameters (?a ?x)
    :precondition (and (hand_empty) (graspable ?a) (clear ?a) (reachable ?a) (accessible ?a) (inside ?a ?x))
    :effect (and (holding ?a) (not (hand_empty)) (not (inside ?a ?x))))
  (:action place-on_item
    :parameters (?a ?b)
    :precondition (and (holding ?a) (level ?b) (reachable ?b) (graspable ?b) (clear ?b))
    :effect (and (on ?a ?b) (stacked ?a) (hand_empty) (not (holding ?a)) (not (clear ?b))))
  (:action place-on_furniture
    :parameters (?a ?b)
    :precondition (and (holding ?a) (level ?b) (reachable ?b))
    :effect (and (on ?a ?b) (hand_empty) (not (holding ?a)) (not (clear ?b))))
  (:action put_in-furniture
    :parameters (?a ?b)
    :precondition (and (holding ?a) (has_door ?b) (open ?b) (reachable ?b))
    :effect (and (inside ?a ?b) (hand_empty) (not (holding ?a))))
  (:action open-door
    :parameters (?a)
    :precondition (and (hand_empty) (has_door ?a) (closed ?a) (reachable ?a))
    :effect (and (open ?a) (not (closed ?a))))
  (:action close-door
    :parameters (?a)
    :precondition (and (hand_empty) (has_door ?a) (open ?a) (reachable ?a))
    :effect (and (closed ?a) (not (open ?a))))
)
